//! A condition: a fact, the bar it must not cross, and for how long.

use core::{fmt, time::Duration};

use sdr_core::{
    recover::{Evidence, RobotEvidence},
    units::{Bytes, Dbm, Permille},
};
use serde::{Deserialize, Serialize};

/// A figure that a rule may watch.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, Deserialize)]
#[non_exhaustive]
pub enum Fact {
    /// Free memory of the robot.
    RobotMemoryFree,
    /// CPU used of the robot, as a share of its capacity.
    RobotCpu,
    /// Charge of the robot.
    RobotBattery,
    /// Radio level of the robot.
    RobotRssi,
    /// CPU of the component against its limit: the larger of its declared need and one core.
    ComponentCpuOfLimit,
    /// CPU of the component against one core.
    ComponentCpuOfCore,
    /// Half a round trip, median over the links that its connections use.
    LinksDelay,
    /// Jitter, median over those links.
    LinksJitter,
    /// Loss, median over those links.
    LinksLoss,
}

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
}

impl Unit {
    /// For errors: how values of it are written.
    pub fn example(self) -> &'static str {
        match self {
            Self::Memory => "a size such as 200MB",
            Self::Share => "a share such as 95%",
            Self::Signal => "a level such as -80dBm",
            Self::Time => "a time such as 200ms",
        }
    }
}

impl Fact {
    /// All of them.
    pub const ALL: [Self; 9] = [
        Self::RobotMemoryFree,
        Self::RobotCpu,
        Self::RobotBattery,
        Self::RobotRssi,
        Self::ComponentCpuOfLimit,
        Self::ComponentCpuOfCore,
        Self::LinksDelay,
        Self::LinksJitter,
        Self::LinksLoss,
    ];

    /// The word that stands in policies; the two CPU facts of a component differ by `of:`.
    pub fn word(self) -> &'static str {
        match self {
            Self::RobotMemoryFree => "robot.memory_free",
            Self::RobotCpu => "robot.cpu",
            Self::RobotBattery => "robot.battery",
            Self::RobotRssi => "robot.rssi",
            Self::ComponentCpuOfLimit | Self::ComponentCpuOfCore => "component.cpu",
            Self::LinksDelay => "links.delay",
            Self::LinksJitter => "links.jitter",
            Self::LinksLoss => "links.loss",
        }
    }

    /// What it is measured in.
    pub fn unit(self) -> Unit {
        match self {
            Self::RobotMemoryFree => Unit::Memory,
            Self::RobotCpu
            | Self::RobotBattery
            | Self::ComponentCpuOfLimit
            | Self::ComponentCpuOfCore
            | Self::LinksLoss => Unit::Share,
            Self::RobotRssi => Unit::Signal,
            Self::LinksDelay | Self::LinksJitter => Unit::Time,
        }
    }

    /// Its value in `evidence`; `None` when unknown.
    pub(crate) fn read(self, evidence: &Evidence) -> Option<Level> {
        match self {
            Self::ComponentCpuOfLimit => {
                let limit = evidence.cpu_limit.0.max(ONE_CORE);
                let share = u64::from(evidence.cpu.0) * 1000 / u64::from(limit);
                Some(Level::Share(Permille(u32::try_from(share).unwrap_or(u32::MAX))))
            }
            Self::ComponentCpuOfCore => Some(Level::Share(evidence.cpu)),
            Self::RobotMemoryFree
            | Self::RobotCpu
            | Self::RobotBattery
            | Self::RobotRssi
            | Self::LinksDelay
            | Self::LinksJitter
            | Self::LinksLoss => self.read_robot(&evidence.robot),
        }
    }

    /// Its value on a robot; `None` when unknown, and for facts of a component.
    pub(crate) fn read_robot(self, robot: &RobotEvidence) -> Option<Level> {
        match self {
            Self::RobotMemoryFree => robot.memory_free.map(Level::Memory),
            Self::RobotCpu => robot.cpu.map(Level::Share),
            Self::RobotBattery => robot.battery.map(Level::Share),
            Self::RobotRssi => robot.rssi.map(Level::Signal),
            Self::LinksDelay => robot.delay.map(Level::Time),
            Self::LinksJitter => robot.jitter.map(Level::Time),
            Self::LinksLoss => robot.loss.map(Level::Share),
            Self::ComponentCpuOfLimit | Self::ComponentCpuOfCore => None,
        }
    }

    /// How it is called in reasons.
    pub(crate) fn label(self) -> &'static str {
        match self {
            Self::RobotMemoryFree => "memory_free",
            Self::RobotCpu => "robot cpu",
            Self::RobotBattery => "battery",
            Self::RobotRssi => "rssi",
            Self::ComponentCpuOfLimit => "cpu of limit",
            Self::ComponentCpuOfCore => "cpu",
            Self::LinksDelay => "delay",
            Self::LinksJitter => "jitter",
            Self::LinksLoss => "loss",
        }
    }
}

/// Thousandths of one core.
const ONE_CORE: u32 = 1000;

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
}

impl Level {
    /// What it is measured in.
    pub fn unit(self) -> Unit {
        match self {
            Self::Memory(_) => Unit::Memory,
            Self::Share(_) => Unit::Share,
            Self::Signal(_) => Unit::Signal,
            Self::Time(_) => Unit::Time,
        }
    }

    /// A number that orders levels of one unit: bytes, thousandths, tenths, nanoseconds.
    pub(crate) fn raw(self) -> i64 {
        match self {
            Self::Memory(bytes) => i64::try_from(bytes.0).unwrap_or(i64::MAX),
            Self::Share(share) => i64::from(share.0),
            Self::Signal(dbm) => i64::from(dbm.tenths()),
            Self::Time(time) => i64::try_from(time.as_nanos()).unwrap_or(i64::MAX),
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
        }
    }
}

/// A bar; both kinds include it.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Bar {
    /// The fault is there at this value and below.
    AtMost(Level),
    /// The fault is there at this value and above.
    AtLeast(Level),
}

impl Bar {
    /// The value of the bar.
    pub fn level(self) -> Level {
        match self {
            Self::AtMost(level) | Self::AtLeast(level) => level,
        }
    }

    /// Whether `found` is at the bar or on the bad side of it.
    pub(crate) fn holds(self, found: i64) -> bool {
        match self {
            Self::AtMost(level) => found <= level.raw(),
            Self::AtLeast(level) => found >= level.raw(),
        }
    }

    /// Whether `found` is at the release level `clear` or on the good side of it.
    pub(crate) fn released(self, clear: Level, found: i64) -> bool {
        match self {
            Self::AtMost(_) => found >= clear.raw(),
            Self::AtLeast(_) => found <= clear.raw(),
        }
    }
}

/// When a raised cause is over.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Clear {
    /// The value that must be reached, bar included, on the good side.
    pub level: Level,
    /// For how long without a break.
    pub hold: Duration,
}

/// A fact over time.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Condition {
    /// What is watched.
    pub fact: Fact,
    /// Where the fault begins.
    pub bar: Bar,
    /// How long without a break it must last before the cause is raised (`for`).
    pub hold: Duration,
    /// When it is over; `None`: as soon as the bar is not met.
    pub clear: Option<Clear>,
    /// The median of the samples of this window is judged; zero judges each sample.
    pub median_over: Duration,
}

/// The window over which a noisy radio level is smoothed unless the policy says otherwise.
pub const RSSI_MEDIAN_OVER: Duration = Duration::from_secs(1);

impl Condition {
    /// A condition that raises after `hold`, is over as soon as the bar is not met any more,
    /// and smooths as the fact needs it: the radio level over [`RSSI_MEDIAN_OVER`], others not.
    pub fn new(fact: Fact, bar: Bar, hold: Duration) -> Self {
        let median_over = match fact.unit() {
            Unit::Signal => RSSI_MEDIAN_OVER,
            Unit::Memory | Unit::Share | Unit::Time => Duration::ZERO,
        };
        Self { fact, bar, hold, clear: None, median_over }
    }

    /// The same, over only when `level` was met for `hold`.
    pub fn clear(self, level: Level, hold: Duration) -> Self {
        Self { clear: Some(Clear { level, hold }), ..self }
    }
}
