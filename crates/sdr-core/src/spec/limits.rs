//! What the process of a component may take, and how it is scheduled.

use alloc::vec::Vec;

use serde::{Deserialize, Serialize};

use crate::units::{Bytes, Permille};

/// Hard limits of one component's process; what is not set is not limited.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct Limits {
    /// Memory; more of it ends the process, or is refused to it.
    pub memory: Option<Bytes>,
    /// CPU, thousandths of one core; more of it is waited for.
    pub cpu: Option<Permille>,
    /// Processes and threads.
    pub pids: Option<u32>,
    /// Niceness, -20..=19.
    pub nice: Option<i8>,
    /// SCHED_FIFO at this priority, 1..=99.
    pub fifo: Option<u8>,
    /// Only on these cores, from 0; empty allows all.
    pub cores: Vec<u16>,
    /// Its memory stays in RAM.
    pub lock_memory: bool,
}

impl Limits {
    /// Whether nothing is limited.
    pub fn is_none(&self) -> bool {
        *self == Self::default()
    }
}

/// What becomes of a component when its agent dies.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum OnAgentDeath {
    /// It goes on, and the next agent adopts it.
    Keep,
    /// It ends.
    Stop,
}
