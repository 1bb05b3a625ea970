//! One component of a system.

use alloc::{string::String, vec::Vec};
use core::time::Duration;

use serde::{Deserialize, Serialize};

use super::{Limits, OnAgentDeath, Value};
use crate::{
    id::{Name, RobotId},
    units::{Bytes, Permille},
};

/// A component as it should run.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct ComponentSpec {
    /// Its name within the system.
    pub name: Name,
    /// Its place in the file, from 0: first-fit takes components in this order.
    pub index: u16,
    /// How its process is started.
    pub launch: Launch,
    /// What it is said to need; the larger of this and what was measured counts.
    pub needs: Needs,
    /// When `on_execute` is called.
    pub execution: Execution,
    /// Parts of the body it must find on its robot, such as `fisheye`.
    pub devices: Vec<Name>,
    /// Where it may run.
    pub place: Place,
    /// Components that must be Active before this one is activated.
    pub after: Vec<Name>,
    /// It moves a body: emergency stops latch, isolation deactivates.
    pub actuator: bool,
    /// What it does when its robot hears nobody.
    pub on_isolation: Isolation,
    /// Wished standbys.
    pub standby: Standby,
    /// Values for its parameters, by name, in the file's order.
    pub parameters: Vec<(String, Value)>,
    /// What becomes of it when its agent dies; `None`: as its robot has it.
    pub on_agent_death: Option<OnAgentDeath>,
    /// What its process may take.
    pub limits: Limits,
}

/// How a process is started. More kinds will be appended.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Launch {
    /// A native executable, found by name in the robot's component path.
    Native {
        /// File name without folder, such as `fisheye`.
        executable: String,
        /// Arguments after those that the agent gives.
        arguments: Vec<String>,
    },
}

impl Launch {
    /// The word robots announce when they can start it.
    pub fn name(&self) -> &str {
        match self {
            Self::Native { executable, .. } => executable,
        }
    }
}

/// Declared need of one component.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct Needs {
    /// Memory while active.
    pub memory: Bytes,
    /// CPU while active, thousandths of one core.
    pub cpu: Permille,
}

/// When `on_execute` is called.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Execution {
    /// At a fixed period.
    Periodic {
        /// Time between two calls, at least 100 us.
        period: Duration,
    },
    /// When any input has a new sample.
    OnData,
}

/// Where a component may run; empty parts allow everything.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct Place {
    /// Only here.
    pub robot: Option<RobotId>,
    /// Only on robots that carry all of these.
    pub labels: Vec<String>,
    /// Not on a robot with one of these.
    pub apart_from: Vec<Name>,
    /// Only on the robot of these.
    pub together_with: Vec<Name>,
}

/// What a component does when its robot hears nobody.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Isolation {
    /// Go on, or stop until somebody is heard.
    pub action: IsolationAction,
    /// How long nobody must have been heard.
    pub after: Duration,
}

/// See [`Isolation`].
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum IsolationAction {
    /// Availability first.
    Continue,
    /// Safety first; the default for actuators.
    Deactivate,
}

/// Wished standbys.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Standby {
    /// How many, 0..=4.
    pub count: u8,
    /// Which robots may hold them.
    pub place: StandbyWhere,
    /// How ready they are.
    pub kind: StandbyKind,
    /// Time between two state checkpoints.
    pub checkpoint: Duration,
    /// Labels, or kinds of labels (`rack` for `rack=2`), that it must not share with its home.
    pub apart: Vec<String>,
}

impl Default for Standby {
    fn default() -> Self {
        Self {
            count: 0,
            place: StandbyWhere::Any,
            kind: StandbyKind::Hot,
            checkpoint: Duration::from_secs(1),
            apart: Vec::new(),
        }
    }
}

/// Which robots may hold a standby.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum StandbyWhere {
    /// The home itself.
    SameRobot,
    /// Any but the home.
    OtherRobot,
    /// Wherever it fits.
    Any,
}

/// How ready a standby is.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum StandbyKind {
    /// Running, initialised, connected, inactive.
    Hot,
    /// Only its place is reserved.
    Cold,
}
