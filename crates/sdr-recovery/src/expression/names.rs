//! The facts that an expression may look at, and what they are measured in.

use sdr_core::recover::Evidence;

use super::eval::Answer;

/// What kind of value something is.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Kind {
    /// True or false.
    Bool,
    /// A whole number.
    Int,
    /// A number with a point.
    Double,
    /// Text.
    Text,
    /// A list in brackets.
    List,
}

impl Kind {
    /// Its name in CEL.
    pub fn word(self) -> &'static str {
        match self {
            Self::Bool => "bool",
            Self::Int => "int",
            Self::Double => "double",
            Self::Text => "string",
            Self::List => "list",
        }
    }
}

macro_rules! names {
    ($($variant:ident $word:literal $kind:ident $about:literal;)*) => {
        /// A fact that an expression may name.
        #[derive(Clone, Copy, Debug, PartialEq, Eq)]
        pub enum Named {
            $(#[doc = $about] $variant,)*
        }

        const ALL: &[Named] = &[$(Named::$variant,)*];

        impl Named {
            /// As it stands in expressions.
            pub fn name(self) -> &'static str {
                match self { $(Self::$variant => $word,)* }
            }

            /// What it is.
            pub fn kind(self) -> Kind {
                match self { $(Self::$variant => Kind::$kind,)* }
            }

            /// For people, with its unit.
            pub fn about(self) -> &'static str {
                match self { $(Self::$variant => $about,)* }
            }
        }
    };
}

names! {
    MemoryFree "robot.memory_free" Double "free memory of the robot, bytes";
    RobotCpu "robot.cpu" Double "CPU used of the robot, 0 to 1 of its capacity";
    Battery "robot.battery" Double "charge, 0 to 1";
    Rssi "robot.rssi" Double "radio level, dBm";
    Delay "links.delay" Double "half a round trip over the component's links, median, seconds";
    DelayWorst "links.delay_worst" Double "the same of the worst link";
    Jitter "links.jitter" Double "jitter over the component's links, median, seconds";
    JitterWorst "links.jitter_worst" Double "the same of the worst link";
    Loss "links.loss" Double "loss over the component's links, median, 0 to 1";
    LossWorst "links.loss_worst" Double "the same of the worst link";
    Component "component.name" Text "name of the component";
    Actuator "component.actuator" Bool "whether it moves a body";
    StandbyHere "component.standby_here" Bool "whether a standby on this robot is ready";
    StandbyElsewhere "component.standby_elsewhere" Bool "whether a standby elsewhere is ready";
    Memory "component.memory" Double "memory of the component, bytes";
    Cpu "component.cpu" Double "CPU of the component, cores";
    CpuLimit "component.cpu_limit" Double "its declared CPU need, cores; 0 when none was declared";
    Exits "component.exits" Int "exits within the last minute";
    Hangs "component.hangs" Int "hangs within the last minute";
    Errors "component.errors" Int "errors within the last minute";
    DeadlineMisses "component.deadline_misses" Int "deadlines that readers of its outputs on this robot missed within the last minute";
    InputsLate "component.inputs_late" Int "deadlines that its inputs from other robots missed within the last minute";
}

/// All facts, in the order of the docs.
pub fn names() -> impl Iterator<Item = Named> {
    ALL.iter().copied()
}

impl Named {
    pub(super) fn of_name(name: &str) -> Option<Self> {
        names().find(|named| named.name() == name)
    }

    /// Its value in `seen`, with what was `counted`; `None` when unknown.
    #[expect(clippy::cast_precision_loss, reason = "bytes for comparisons with bars")]
    pub(crate) fn read<'a>(self, seen: &'a Evidence, counted: &Counted) -> Option<Answer<'a>> {
        let robot = &seen.robot;
        let share = |permille: u32| f64::from(permille) / 1000.0;
        let seconds = |time: core::time::Duration| time.as_secs_f64();
        let number = match self {
            Self::Component => return Some(Answer::Text(seen.component.name.as_str())),
            Self::Actuator => return Some(Answer::Bool(seen.actuator)),
            Self::StandbyHere => return Some(Answer::Bool(seen.standby_here)),
            Self::StandbyElsewhere => return Some(Answer::Bool(seen.standby_elsewhere)),
            Self::Exits => return Some(Answer::Int(counted.exits)),
            Self::Hangs => return Some(Answer::Int(counted.hangs)),
            Self::Errors => return Some(Answer::Int(counted.errors)),
            Self::DeadlineMisses => return Some(Answer::Int(counted.deadline_misses)),
            Self::InputsLate => return Some(Answer::Int(counted.inputs_late)),
            Self::MemoryFree => robot.memory_free?.0 as f64,
            Self::RobotCpu => share(robot.cpu?.0),
            Self::Battery => share(robot.battery?.0),
            Self::Rssi => f64::from(robot.rssi?.tenths()) / 10.0,
            Self::Delay => seconds(robot.delay?.median),
            Self::DelayWorst => seconds(robot.delay?.worst),
            Self::Jitter => seconds(robot.jitter?.median),
            Self::JitterWorst => seconds(robot.jitter?.worst),
            Self::Loss => share(robot.loss?.median.0),
            Self::LossWorst => share(robot.loss?.worst.0),
            Self::Memory => seen.memory.0 as f64,
            Self::Cpu => share(seen.cpu.0),
            Self::CpuLimit => share(seen.cpu_limit.0),
        };
        Some(Answer::Double(number))
    }
}

/// The counts of the last minute at some moment.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Counted {
    pub(crate) exits: i64,
    pub(crate) hangs: i64,
    pub(crate) errors: i64,
    pub(crate) deadline_misses: i64,
    pub(crate) inputs_late: i64,
}

/// Constants that make bars readable: `robot.memory_free < 200.0 * MB`.
pub(super) fn constant(name: &str) -> Option<f64> {
    Some(match name {
        "kB" => 1e3,
        "MB" => 1e6,
        "GB" => 1e9,
        "MiB" => 1_048_576.0,
        "GiB" => 1_073_741_824.0,
        "ms" => 1e-3,
        _ => return None,
    })
}
