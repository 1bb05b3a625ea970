//! One connection between two ports.

use alloc::{format, string::String};
use core::{fmt, time::Duration};

use serde::{Deserialize, Serialize};

use crate::id::{ComponentKey, Name};

/// A port of a component of the same system.
#[derive(Clone, Debug, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, Deserialize)]
pub struct PortRef {
    /// The component.
    pub component: Name,
    /// Its port.
    pub port: Name,
}

impl fmt::Display for PortRef {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}.{}", self.component, self.port)
    }
}

/// Which output feeds which input, and how.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct ConnectionSpec {
    /// Its place in the file, from 0.
    pub index: u16,
    /// The output.
    pub from: PortRef,
    /// The input.
    pub to: PortRef,
    /// The ROS 2 type of both ports, such as `sensor_msgs/msg/Image`.
    pub message_type: String,
    /// How samples travel.
    pub qos: Qos,
}

impl ConnectionSpec {
    /// `fisheye.image -> anomaly.image`.
    pub fn label(&self) -> String {
        format!("{} -> {}", self.from, self.to)
    }
}

/// How samples of a connection travel.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Qos {
    /// Whether lost samples are sent again between robots.
    pub reliability: Reliability,
    /// How many samples a slow reader may fall behind before the oldest are lost, 1..=64.
    pub depth: u8,
    /// Longest pause that is still fine; longer ones are counted as late.
    pub deadline: Option<Duration>,
}

impl Default for Qos {
    fn default() -> Self {
        Self { reliability: Reliability::Reliable, depth: 8, deadline: None }
    }
}

/// Whether lost samples are sent again.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Reliability {
    /// Sent again until acknowledged, within the writer's history.
    Reliable,
    /// Sent once.
    BestEffort,
}

/// The name of an output as it stands in shared memory: `system/component/port`.
///
/// Its DDS topic is this behind `rt/`.
pub fn port_path(component: &ComponentKey, port: &Name) -> String {
    match &component.scope {
        Some(robot) => {
            format!("{}/{}/{}/{}", robot.topic_word(), component.system, component.name, port)
        }
        None => format!("{}/{}/{}", component.system, component.name, port),
    }
}
