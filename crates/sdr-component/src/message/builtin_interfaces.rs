//! Package `builtin_interfaces`.

use serde::{Deserialize, Serialize};

use crate::plain_message;

/// A moment, wall time by custom.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct Time {
    /// Seconds.
    pub sec: i32,
    /// Nanoseconds within the second.
    pub nanosec: u32,
}

impl Time {
    /// From a count of nanoseconds; saturates in the year 2038.
    pub fn from_nanos(nanos: u64) -> Self {
        Self {
            sec: i32::try_from(nanos / 1_000_000_000).unwrap_or(i32::MAX),
            nanosec: u32::try_from(nanos % 1_000_000_000).unwrap_or(0),
        }
    }

    /// As a count of nanoseconds; 0 when negative.
    pub fn as_nanos(self) -> u64 {
        u64::try_from(self.sec).unwrap_or(0) * 1_000_000_000 + u64::from(self.nanosec)
    }
}

/// A length of time.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct Duration {
    /// Seconds.
    pub sec: i32,
    /// Nanoseconds within the second.
    pub nanosec: u32,
}

plain_message!(Time, "builtin_interfaces/msg/Time", "int32 sec\nuint32 nanosec\n");
plain_message!(Duration, "builtin_interfaces/msg/Duration", "int32 sec\nuint32 nanosec\n");
