//! What a robot says of itself: records in its author's table.
//!
//! Fields are only ever appended; a reader that does not know the last ones skips them.

use alloc::{string::String, vec::Vec};
use core::time::Duration;

use serde::{Deserialize, Serialize};

use crate::{
    allocate::Homeless,
    id::{ComponentKey, Name, RobotId},
    lifecycle::LifecycleState,
    order::Token,
    recover::{Cause, Remedy},
    units::{Bytes, Dbm, Permille, Position},
};

/// What rarely changes: the body and its limits.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct RobotFacts {
    /// Memory that components may use in all.
    pub memory_capacity: Bytes,
    /// CPU that components may use in all, thousandths of one core.
    pub cpu_capacity: Permille,
    /// Free words that a system may ask for.
    pub labels: Vec<String>,
    /// Parts of the body.
    pub devices: Vec<Name>,
    /// Hashes of what it can launch ([`crate::spec::launch_hash`]), sorted.
    pub launchables: Vec<u32>,
    /// Preference for the coordinator role.
    pub role: RolePreference,
    /// Where its API listens, for tools on the same machine.
    pub api: String,
    /// The agent's version.
    pub version: String,
}

/// Whether a robot should hold the coordinator role.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum RolePreference {
    /// Before all others while it lives.
    Preferred,
    /// By fitness.
    #[default]
    Able,
    /// Never.
    Forbidden,
}

/// What changes by the second.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct HostReport {
    /// Memory used by the agent and all below it (PSS).
    pub memory_used: Bytes,
    /// CPU used by the agent and all below it, thousandths of one core.
    pub cpu_used: Permille,
    /// Charge, 0..=1000; `None` when nobody can tell.
    pub battery: Option<Permille>,
    /// Radio level towards the access point or mesh; `None` when unknown, never zero.
    pub rssi: Option<Dbm>,
    /// Where it stands.
    pub position: Option<Position>,
    /// Of the memory used: by others than the agent and its components; nothing where the
    /// capacity was set by hand.
    pub memory_other: Bytes,
    /// Of the CPU used: by others, mean of the last seconds; nothing where the capacity was set
    /// by hand.
    pub cpu_other: Permille,
}

/// What the agent measured of one pair of robots.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct LinkReport {
    /// Round trip, median of the last samples.
    pub rtt: Duration,
    /// Mean change from one round trip to the next (RFC 3550, section 6.4.1).
    pub jitter: Duration,
    /// Lost of the last 64 datagrams there or back, thousandths: what a question with its
    /// answer suffers.
    pub loss: Permille,
    /// Lost of the last 64 datagrams to the other robot, as it counts them.
    pub loss_out: Permille,
    /// Lost of the last 64 datagrams from the other robot.
    pub loss_in: Permille,
}

/// What an instance does on its robot.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct InstanceReport {
    /// The component it is an instance of.
    pub component: ComponentKey,
    /// Its state.
    pub state: LifecycleState,
    /// The token it works under; `None` while it is only prepared.
    pub token: Option<Token>,
    /// Initialised and, when it has remote peers, connected to them: activation is instant.
    pub ready: bool,
    /// What it takes.
    pub usage: Usage,
    /// Per input connection (index in the system): the greatest token accepted.
    pub heard: Vec<(u16, Token)>,
    /// Restarts under the present epoch.
    pub restarts: u16,
    /// A second instance on the same robot could take over at once.
    pub spare_ready: bool,
}

/// Measured use of one instance.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct Usage {
    /// Memory (PSS).
    pub memory: Bytes,
    /// CPU, thousandths of one core.
    pub cpu: Permille,
}

/// A home in trouble says so; the coordinator acts.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct ConditionReport {
    /// The system concerned.
    pub system: Name,
    /// What is wrong.
    pub cause: Cause,
    /// Components that should leave, placed as one problem.
    pub components: Vec<Name>,
    /// The rung the ladder stands on.
    pub remedy: Remedy,
    /// With numbers, for people.
    pub reason: String,
    /// Milliseconds since the cause had held for its whole time, when this was made.
    pub held_over_ms: u64,
    /// Whether it is only foreseen: it holds, but not yet for its whole time. Others get
    /// ready, and nothing moves.
    pub foreseen: bool,
}

/// What the holder of the coordinator role says of those who may follow it.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct SuccessionReport {
    /// The term it speaks of.
    pub term: u64,
    /// Who takes over when it is silent, the first first; they hear its beats directly.
    pub order: Vec<RobotId>,
    /// Period of those beats.
    pub beat: Duration,
    /// Beats that may be missed on a good link.
    pub misses: u32,
    /// Who should take the role now.
    pub offered_to: Option<RobotId>,
    /// Why it is offered.
    pub reason: String,
}

/// What a robot has on its disk, said while something is undeployed.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct StoredReport {
    /// Hash of the fleet table there.
    pub root: u64,
    /// Every robot it ever heard of, also before its last start.
    pub robots: Vec<RobotId>,
}

/// Everything an author may say, one record each.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub enum Report {
    /// The body.
    Facts(RobotFacts),
    /// Host figures.
    Host(HostReport),
    /// A link to another robot.
    Link(RobotId, LinkReport),
    /// An instance.
    Instance(InstanceReport),
    /// Trouble.
    Condition(ConditionReport),
    /// The coordinator found no home for a component.
    Homeless(Homeless),
    /// The coordinator's successors.
    Succession(SuccessionReport),
    /// What is on disk.
    Stored(StoredReport),
}
