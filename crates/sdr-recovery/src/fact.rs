//! A fact: a figure that a rule may watch.

use sdr_core::{
    recover::{Evidence, RobotEvidence, Spread},
    units::Permille,
};
use serde::{Deserialize, Serialize};

use crate::level::{Level, Unit};

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
    /// Half a round trip, over the links that its connections use.
    LinksDelay,
    /// Jitter, over those links.
    LinksJitter,
    /// Loss, over those links.
    LinksLoss,
    /// Memory of the component.
    ComponentMemory,
    /// How often its process ended without being told to, or did not come up.
    ComponentExits,
    /// How often its execution thread hung.
    ComponentHangs,
    /// How often it went to its error state, with a reason or without.
    ComponentErrors,
    /// Deadlines of readers on this robot that its outputs missed.
    DeadlineMisses,
    /// Deadlines that its inputs from other robots missed.
    InputsLate,
    /// What an expression or a program says; no word of policies.
    Told,
}

/// Which of several links counts.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Over {
    /// The one in the middle.
    #[default]
    Median,
    /// The worst.
    Worst,
    /// The best.
    Best,
}

impl Over {
    /// The word that stands in policies.
    pub fn word(self) -> &'static str {
        match self {
            Self::Median => "median",
            Self::Worst => "worst",
            Self::Best => "best",
        }
    }

    pub(crate) fn of<T: Copy>(self, spread: Spread<T>) -> T {
        match self {
            Self::Median => spread.median,
            Self::Worst => spread.worst,
            Self::Best => spread.best,
        }
    }
}

impl Fact {
    /// Those that a policy may name.
    pub const ALL: [Self; 15] = [
        Self::RobotMemoryFree,
        Self::RobotCpu,
        Self::RobotBattery,
        Self::RobotRssi,
        Self::ComponentCpuOfLimit,
        Self::ComponentCpuOfCore,
        Self::LinksDelay,
        Self::LinksJitter,
        Self::LinksLoss,
        Self::ComponentMemory,
        Self::ComponentExits,
        Self::ComponentHangs,
        Self::ComponentErrors,
        Self::DeadlineMisses,
        Self::InputsLate,
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
            Self::ComponentMemory => "component.memory",
            Self::ComponentExits => "component.exits",
            Self::ComponentHangs => "component.hangs",
            Self::ComponentErrors => "component.errors",
            Self::DeadlineMisses => "component.deadline_misses",
            Self::InputsLate => "component.inputs_late",
            Self::Told => "told",
        }
    }

    /// What it is measured in.
    pub fn unit(self) -> Unit {
        match self {
            Self::RobotMemoryFree | Self::ComponentMemory => Unit::Memory,
            Self::RobotCpu
            | Self::RobotBattery
            | Self::ComponentCpuOfLimit
            | Self::ComponentCpuOfCore
            | Self::LinksLoss => Unit::Share,
            Self::RobotRssi => Unit::Signal,
            Self::LinksDelay | Self::LinksJitter => Unit::Time,
            Self::ComponentExits
            | Self::ComponentHangs
            | Self::ComponentErrors
            | Self::DeadlineMisses
            | Self::InputsLate => Unit::Rate,
            Self::Told => Unit::Flag,
        }
    }

    /// Whether all components of a robot see the same figure.
    pub(crate) fn is_shared(self) -> bool {
        match self {
            Self::RobotMemoryFree | Self::RobotCpu | Self::RobotBattery | Self::RobotRssi => true,
            Self::ComponentCpuOfLimit
            | Self::ComponentCpuOfCore
            | Self::LinksDelay
            | Self::LinksJitter
            | Self::LinksLoss
            | Self::ComponentMemory
            | Self::ComponentExits
            | Self::ComponentHangs
            | Self::ComponentErrors
            | Self::DeadlineMisses
            | Self::InputsLate
            | Self::Told => false,
        }
    }

    /// Whether a bad figure lies with the robot or its links, not with the component.
    pub(crate) fn is_of_robot(self) -> bool {
        matches!(self, Self::LinksDelay | Self::LinksJitter | Self::LinksLoss) || self.is_shared()
    }

    /// Its value in `evidence`; `None` when unknown, and for what is counted or told.
    pub(crate) fn read(self, evidence: &Evidence, over: Over) -> Option<Level> {
        match self {
            Self::ComponentCpuOfLimit => {
                let limit = evidence.cpu_limit.0.max(ONE_CORE);
                let share = u64::from(evidence.cpu.0) * 1000 / u64::from(limit);
                Some(Level::Share(Permille(u32::try_from(share).unwrap_or(u32::MAX))))
            }
            Self::ComponentCpuOfCore => Some(Level::Share(evidence.cpu)),
            Self::ComponentMemory => Some(Level::Memory(evidence.memory)),
            Self::RobotMemoryFree
            | Self::RobotCpu
            | Self::RobotBattery
            | Self::RobotRssi
            | Self::LinksDelay
            | Self::LinksJitter
            | Self::LinksLoss => self.read_robot(&evidence.robot, over),
            Self::ComponentExits
            | Self::ComponentHangs
            | Self::ComponentErrors
            | Self::DeadlineMisses
            | Self::InputsLate
            | Self::Told => None,
        }
    }

    /// Its value on a robot; `None` when unknown, and for facts of a component.
    pub(crate) fn read_robot(self, robot: &RobotEvidence, over: Over) -> Option<Level> {
        match self {
            Self::RobotMemoryFree => robot.memory_free.map(Level::Memory),
            Self::RobotCpu => robot.cpu.map(Level::Share),
            Self::RobotBattery => robot.battery.map(Level::Share),
            Self::RobotRssi => robot.rssi.map(Level::Signal),
            Self::LinksDelay => robot.delay.map(|spread| Level::Time(over.of(spread))),
            Self::LinksJitter => robot.jitter.map(|spread| Level::Time(over.of(spread))),
            Self::LinksLoss => robot.loss.map(|spread| Level::Share(over.of(spread))),
            Self::ComponentCpuOfLimit
            | Self::ComponentCpuOfCore
            | Self::ComponentMemory
            | Self::ComponentExits
            | Self::ComponentHangs
            | Self::ComponentErrors
            | Self::DeadlineMisses
            | Self::InputsLate
            | Self::Told => None,
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
            Self::ComponentMemory => "memory",
            Self::ComponentExits => "exits",
            Self::ComponentHangs => "hangs",
            Self::ComponentErrors => "errors",
            Self::DeadlineMisses => "deadlines missed",
            Self::InputsLate => "inputs late",
            Self::Told => "told",
        }
    }
}

/// Thousandths of one core.
const ONE_CORE: u32 = 1000;
