//! What can be seen of a fleet from outside, for those who only watch.

use sdr_core::{api::DeployAnswer, event::Event, id::Name, input::InstanceId, order::Token};

/// One thing that truly happened, whatever the robots believe.
#[derive(Debug, Clone)]
pub enum Sight {
    /// A robot's agent starts.
    On {
        /// Which one.
        robot: usize,
        /// Whether it found its disk as it left it.
        disk_kept: bool,
    },
    /// A robot lost power.
    Off {
        /// Which one.
        robot: usize,
    },
    /// A brain said that something happened.
    Told {
        /// Which one.
        robot: usize,
        /// What.
        event: Event,
    },
    /// A process was started.
    Launched {
        /// Where.
        robot: usize,
        /// Of which component, by number.
        component: usize,
    },
    /// A process is active from now on.
    Active {
        /// Where.
        robot: usize,
        /// Which process there.
        instance: InstanceId,
        /// Of which component, by number.
        component: usize,
        /// Under which token.
        token: Token,
    },
    /// A process is not active any more.
    Inactive {
        /// Where.
        robot: usize,
        /// Which process there.
        instance: InstanceId,
        /// Of which component, by number.
        component: usize,
    },
    /// The fence of a consumer let the first sample of another token through.
    Accepted {
        /// Where.
        robot: usize,
        /// Which process there.
        instance: InstanceId,
        /// Which of its connections.
        connection: u16,
        /// The token accepted.
        token: Token,
    },
    /// An operator asked for something.
    Asked {
        /// Whom.
        robot: usize,
        /// About which system.
        system: Name,
    },
    /// An agent answered an operator.
    Answered {
        /// Which one.
        robot: usize,
        /// What.
        answer: Result<DeployAnswer, String>,
    },
    /// An allocator was asked.
    Planned {
        /// By whom.
        robot: usize,
    },
    /// A cut ended.
    Healed,
    /// All faults are over; from here on everything must come right.
    Calm,
    /// Time to look around.
    Look,
}
