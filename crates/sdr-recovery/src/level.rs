//! A value of some fact, and what it is measured in.

use core::{fmt, time::Duration};

use sdr_core::units::{Bytes, Dbm, Permille};
use serde::{Deserialize, Serialize};

/// What a fact is measured in.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Unit {
    /// Bytes.
    Memory,
    /// Thousandths.
    Share,
    /// Tenths of a dBm.
    Signal,
    /// Time.
    Time,
    /// How often within some time.
    Rate,
    /// So or not.
    Flag,
}

impl Unit {
    /// For errors: how values of it are written.
    pub fn example(self) -> &'static str {
        match self {
            Self::Memory => "a size such as 200MB",
            Self::Share => "a share such as 95%",
            Self::Signal => "a level such as -80dBm",
            Self::Time => "a time such as 200ms",
            Self::Rate => "a rate such as `3 per 1min`",
            Self::Flag => "true or false",
        }
    }
}

/// A value of some fact, with its unit.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub enum Level {
    /// Bytes.
    Memory(Bytes),
    /// Thousandths.
    Share(Permille),
    /// Radio level.
    Signal(Dbm),
    /// Time.
    Time(Duration),
    /// So often within the time of the condition.
    Count(u32),
    /// So or not.
    Flag(bool),
}

impl Level {
    /// What it is measured in.
    pub fn unit(self) -> Unit {
        match self {
            Self::Memory(_) => Unit::Memory,
            Self::Share(_) => Unit::Share,
            Self::Signal(_) => Unit::Signal,
            Self::Time(_) => Unit::Time,
            Self::Count(_) => Unit::Rate,
            Self::Flag(_) => Unit::Flag,
        }
    }

    /// A number that orders levels of one unit: bytes, thousandths, tenths, nanoseconds.
    pub(crate) fn raw(self) -> i64 {
        match self {
            Self::Memory(bytes) => i64::try_from(bytes.0).unwrap_or(i64::MAX),
            Self::Share(share) => i64::from(share.0),
            Self::Signal(dbm) => i64::from(dbm.tenths()),
            Self::Time(time) => i64::try_from(time.as_nanos()).unwrap_or(i64::MAX),
            Self::Count(count) => i64::from(count),
            Self::Flag(flag) => i64::from(flag),
        }
    }

    /// A level of the same unit from its number.
    pub(crate) fn with_raw(self, raw: i64) -> Self {
        let size = u64::try_from(raw).unwrap_or(0);
        match self {
            Self::Memory(_) => Self::Memory(Bytes(size)),
            Self::Share(_) => Self::Share(Permille(u32::try_from(size).unwrap_or(u32::MAX))),
            Self::Signal(_) => {
                Self::Signal(Dbm::from_tenths(i16::try_from(raw).unwrap_or(i16::MIN)))
            }
            Self::Time(_) => Self::Time(Duration::from_nanos(size)),
            Self::Count(_) => Self::Count(u32::try_from(size).unwrap_or(u32::MAX)),
            Self::Flag(_) => Self::Flag(raw != 0),
        }
    }
}

impl fmt::Display for Level {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Memory(bytes) => write!(f, "{bytes}"),
            Self::Share(share) => write!(f, "{share}"),
            Self::Signal(dbm) => write!(f, "{dbm}"),
            Self::Time(time) => {
                let micros = time.as_micros();
                write!(f, "{}.{} ms", micros / 1000, micros / 100 % 10)
            }
            Self::Count(count) => write!(f, "{count}"),
            Self::Flag(flag) => write!(f, "{flag}"),
        }
    }
}
