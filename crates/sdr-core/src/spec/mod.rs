//! What should run: a system, its components and connections, already checked.
//!
//! These are the types that travel in the fleet table, so fields are only ever appended.
//! The files that people write are read in `sdr-files` and become these.

mod component;
mod connection;
mod limits;
mod value;

use alloc::vec::Vec;

use serde::{Deserialize, Serialize};
use thiserror::Error;

use crate::{
    id::{ComponentKey, Name, RobotId},
    order::hash64,
};
pub use component::{
    ComponentSpec, Execution, Isolation, IsolationAction, Launch, Needs, Place, Standby,
    StandbyKind, StandbyWhere,
};
pub use connection::{ConnectionSpec, PortRef, Qos, Reliability, port_path};
pub use limits::{Limits, OnAgentDeath};
pub use value::{LISTS_DEEP_MAX, Value};

/// A policy as its crate encoded it; the core only carries it.
///
/// Allocation policies are `sdr_alloc::Policy`, recovery policies `sdr_recovery::Policy`,
/// both in postcard.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct PolicyBytes {
    /// The policy's name, for reasons and reports.
    pub name: alloc::string::String,
    /// The encoded policy; empty means the default policy.
    pub bytes: Vec<u8>,
}

/// A whole system as `sdr deploy` takes it.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct SystemSpec {
    /// Its name; one system of that name runs in a fleet.
    pub name: Name,
    /// In the order of the file, which first-fit follows.
    pub components: Vec<ComponentSpec>,
    /// Which port feeds which.
    pub connections: Vec<ConnectionSpec>,
    /// How to place.
    pub allocation: PolicyBytes,
    /// What to do in trouble.
    pub recovery: PolicyBytes,
}

/// Most components, and most connections, of one system.
pub const PARTS_MAX: usize = 512;

/// Why a system cannot be deployed. The caller can mend it; nothing was changed.
#[derive(Clone, Debug, PartialEq, Eq, Error)]
#[non_exhaustive]
pub enum SpecError {
    /// Two components of one name.
    #[error("component `{0}` is there twice")]
    DuplicateComponent(Name),
    /// A connection or `after` names a component that is not in the system.
    #[error("`{0}` is no component of this system")]
    UnknownComponent(Name),
    /// `after` leads back to where it began.
    #[error("start order goes round in a circle through `{0}`")]
    StartCycle(Name),
    /// One input fed twice from the same output.
    #[error("connection {0} is there twice")]
    DuplicateConnection(alloc::string::String),
    /// Too much for one system.
    #[error("{found} {what}; at most {PARTS_MAX}")]
    TooMany {
        /// Components or connections.
        what: &'static str,
        /// How many were given.
        found: usize,
    },
    /// Nothing to run.
    #[error("a system has at least one component")]
    Empty,
}

impl SystemSpec {
    /// Checks what no single field can say: names known, no duplicates, no circle in `after`.
    pub fn check(&self) -> Result<(), SpecError> {
        if self.components.is_empty() {
            return Err(SpecError::Empty);
        }
        for (what, found) in
            [("components", self.components.len()), ("connections", self.connections.len())]
        {
            if found > PARTS_MAX {
                return Err(SpecError::TooMany { what, found });
            }
        }
        for (index, component) in self.components.iter().enumerate() {
            if self.components[..index].iter().any(|other| other.name == component.name) {
                return Err(SpecError::DuplicateComponent(component.name.clone()));
            }
            for before in &component.after {
                self.known(before)?;
            }
        }
        for (index, connection) in self.connections.iter().enumerate() {
            self.known(&connection.from.component)?;
            self.known(&connection.to.component)?;
            let same =
                |other: &ConnectionSpec| other.from == connection.from && other.to == connection.to;
            if self.connections[..index].iter().any(same) {
                return Err(SpecError::DuplicateConnection(connection.label()));
            }
        }
        self.check_start_order()
    }

    /// The component of that name.
    pub fn component(&self, name: &Name) -> Option<&ComponentSpec> {
        self.components.iter().find(|component| component.name == *name)
    }

    /// The fleet-wide key of one of its components.
    pub fn key(&self, name: &Name) -> ComponentKey {
        ComponentKey::new(&self.name, name)
    }

    fn known(&self, name: &Name) -> Result<(), SpecError> {
        match self.component(name) {
            Some(_) => Ok(()),
            None => Err(SpecError::UnknownComponent(name.clone())),
        }
    }

    /// Takes away components whose predecessors are all gone until none is left.
    fn check_start_order(&self) -> Result<(), SpecError> {
        let mut waiting: Vec<&ComponentSpec> = self.components.iter().collect();
        loop {
            let before = waiting.len();
            let names: Vec<&Name> = waiting.iter().map(|component| &component.name).collect();
            waiting.retain(|component| component.after.iter().any(|name| names.contains(&name)));
            match waiting.first() {
                None => return Ok(()),
                Some(first) if waiting.len() == before => {
                    return Err(SpecError::StartCycle(first.name.clone()));
                }
                Some(_) => {}
            }
        }
    }
}

/// What a component executable says of itself (`--describe`, and in its greeting).
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct ComponentProfile {
    /// The name it is launched by, such as `fisheye`.
    pub name: alloc::string::String,
    /// One sentence for people.
    #[serde(default)]
    pub about: alloc::string::String,
    /// Ports that can be fed.
    pub inputs: Vec<PortProfile>,
    /// Ports that feed others.
    pub outputs: Vec<PortProfile>,
    /// Parameters it knows; others are refused.
    #[serde(default)]
    pub parameters: Vec<ParameterProfile>,
    /// Parts of the body it must find.
    #[serde(default)]
    pub devices: Vec<DeviceProfile>,
}

/// A part of the body that a component must find.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct DeviceProfile {
    /// Its name in robot.toml.
    pub name: alloc::string::String,
    /// A parameter that makes it unneeded once it is given a value other than its default.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub unless: Option<alloc::string::String>,
}

/// One port of a [`ComponentProfile`].
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct PortProfile {
    /// The port's name.
    pub name: Name,
    /// The ROS 2 type, such as `sensor_msgs/msg/Image`.
    pub message_type: alloc::string::String,
    /// Expected size of one sample in bytes; a first allocation, not a bound.
    #[serde(default)]
    pub size_hint_bytes: u32,
}

/// One parameter of a [`ComponentProfile`].
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct ParameterProfile {
    /// The parameter's name.
    pub name: alloc::string::String,
    /// What it means, with its unit.
    #[serde(default)]
    pub about: alloc::string::String,
    /// The value when the system file gives none; its kind is the kind required.
    pub default: Value,
    /// Least value, of numbers with a range.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub min: Option<Value>,
    /// Greatest value, of numbers with a range.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub max: Option<Value>,
}

/// What robots announce about the executables they have: a hash of the launch name, 32 bits.
pub fn launch_hash(name: &str) -> u32 {
    let hash = hash64(name.as_bytes());
    u32::try_from((hash ^ (hash >> 32)) & 0xffff_ffff).unwrap_or(0)
}

/// A request to deploy: the system and who received it.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Deployment {
    /// What should run.
    pub system: SystemSpec,
    /// The robot that took the file from the operator.
    pub receiver: RobotId,
    /// Grows with each deployment of this system; 1 is the first.
    pub revision: u64,
}

#[cfg(test)]
pub(crate) mod tests;
