//! The seam for placing components: a problem in, a plan with reasons out.
//!
//! The brain makes a [`Problem`] from its view, the shell carries it to an [`Allocator`]
//! off the loop, and the [`Plan`] comes back as an input with the view's version.

use alloc::{string::String, vec::Vec};
use core::time::Duration;

use serde::{Deserialize, Serialize};
use thiserror::Error;

use crate::{
    id::{ComponentKey, Name, RobotId},
    spec::{Needs, Place, PolicyBytes},
    units::{Bytes, Dbm, Permille, Position},
};

/// Decides which robot runs which component.
///
/// Equal problems must give equal answers on every robot: no clock, no unseeded
/// randomness, no dependence on map order.
pub trait Allocator {
    /// Short name for files, logs and benches, such as `"first-fit"`.
    fn name(&self) -> &'static str;

    /// Places as many components as fit and lists the rest as homeless, with reasons.
    fn allocate(&self, problem: &Problem) -> Plan;
}

/// Which bars count.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Tier {
    /// Reliability first: deployment.
    Strict,
    /// Availability first: recovery. The strict bars are tried first, then the relaxed ones.
    Relaxed,
}

/// One question to an allocator.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Problem {
    /// Which bars count.
    pub tier: Tier,
    /// The system's allocation policy, encoded.
    pub policy: PolicyBytes,
    /// The robot that received the file.
    pub receiver: RobotId,
    /// Robots that are alive, by name.
    pub robots: Vec<RobotOffer>,
    /// What needs a home, in the order of the file.
    pub items: Vec<Item>,
    /// Components of the same system that stay where they are.
    pub settled: Vec<Settled>,
    /// Connections of the system.
    pub connections: Vec<Wire>,
    /// Measured pairs; a pair that is missing is unknown.
    pub pairs: Vec<Pair>,
}

/// What a robot has to offer.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct RobotOffer {
    /// Which robot.
    pub robot: RobotId,
    /// Capacity less the larger of declared and measured need of all that is or will be there,
    /// without the items of this problem.
    pub memory_free: Bytes,
    /// CPU that components may use in all, thousandths of one core.
    pub cpu_capacity: Permille,
    /// CPU left, counted like memory, thousandths of one core.
    pub cpu_free: Permille,
    /// Charge; `None` when unknown.
    pub battery: Option<Permille>,
    /// Radio level; `None` when unknown.
    pub rssi: Option<Dbm>,
    /// Where it stands; `None` when unknown.
    pub position: Option<Position>,
    /// Free words.
    pub labels: Vec<String>,
    /// Parts of the body.
    pub devices: Vec<Name>,
    /// Hashes of what it can launch, sorted.
    pub launchables: Vec<u32>,
}

/// A component that needs a home.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Item {
    /// Which component.
    pub component: ComponentKey,
    /// The larger of declared and measured need.
    pub needs: Needs,
    /// Hash of what must be launched there.
    pub launch: u32,
    /// Parts of the body it must find.
    pub devices: Vec<Name>,
    /// Where it may run.
    pub place: Place,
    /// Where an instance runs already (home or standby).
    pub running_on: Vec<RobotId>,
    /// Robots that it must not go to now, with the reason.
    pub avoid: Vec<(RobotId, String)>,
}

/// A component that stays.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Settled {
    /// Its name.
    pub name: Name,
    /// Its home.
    pub home: RobotId,
}

/// Two components that talk.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Wire {
    /// The producer.
    pub from: Name,
    /// The consumer.
    pub to: Name,
}

/// What is known of one pair of robots, `a` before `b` by name.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Pair {
    /// One end.
    pub a: RobotId,
    /// The other end.
    pub b: RobotId,
    /// Change from one round trip to the next.
    pub jitter: Option<Duration>,
    /// Half a round trip.
    pub delay: Option<Duration>,
    /// Lost datagrams.
    pub loss: Option<Permille>,
}

/// An answer.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Plan {
    /// The allocator that made it.
    pub allocator: String,
    /// Who goes where, in the order of the items.
    pub placements: Vec<Placement>,
    /// Who has no home, and why.
    pub homeless: Vec<Homeless>,
}

/// One placed component.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Placement {
    /// Which component.
    pub component: ComponentKey,
    /// Its home.
    pub robot: RobotId,
    /// Which bars it met.
    pub tier: Tier,
    /// Memory left there after placing it.
    pub memory_left: Bytes,
    /// Robots tried before and why not.
    pub refusals: Vec<Refusal>,
}

/// One component without a home.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Homeless {
    /// Which component.
    pub component: ComponentKey,
    /// Each robot and why not.
    pub refusals: Vec<Refusal>,
}

/// Why a component cannot go to a robot: the number and the bar.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Refusal {
    /// The robot.
    pub robot: RobotId,
    /// The constraint, such as `memory_free`, `rssi`, `devices`.
    pub constraint: String,
    /// What was found, with its unit.
    pub found: String,
    /// What is wanted, with its unit.
    pub bar: String,
}

impl core::fmt::Display for Refusal {
    /// `robot-1: memory_free 310 MB, bar 500 MB`.
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        write!(f, "{}: {} {}, bar {}", self.robot, self.constraint, self.found, self.bar)
    }
}

/// Why a problem cannot even be tried. The author of the policy can mend it.
#[derive(Clone, Debug, PartialEq, Eq, Error)]
#[non_exhaustive]
pub enum AllocError {
    /// The policy's bytes are not a policy.
    #[error("allocation policy `{0}` cannot be read")]
    Policy(String),
}
