//! The seam for recovery: evidence in, verdicts out.
//!
//! Each robot judges its own components with one [`Recovery`] per system; robots that are
//! gone are judged by the coordinator. Local remedies are carried out at once; the others
//! are published as a condition on which the coordinator acts.

use alloc::{string::String, vec::Vec};
use core::time::Duration;

use serde::{Deserialize, Serialize};

pub use crate::cause::{CAUSE_BYTES_MAX, Cause, CauseName, CauseNameError};
use crate::{
    fitness::Alone,
    id::ComponentKey,
    time::Instant,
    units::{Bytes, Dbm, Permille},
};

/// What to try; the order of variants is the order of severity.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Remedy {
    /// Switch to a standby on the same robot.
    LocalStandby,
    /// End the process and start it anew on the same robot, not before `after` from now.
    Restart {
        /// Backoff.
        after: Duration,
    },
    /// Switch to a standby on another robot.
    StandbyElsewhere,
    /// Start it on another robot.
    LaunchElsewhere,
    /// Stop trying, say so.
    Hold,
}

impl Remedy {
    /// The word that stands in policies, events and reports.
    pub fn word(self) -> &'static str {
        match self {
            Self::LocalStandby => "local-standby",
            Self::Restart { .. } => "restart",
            Self::StandbyElsewhere => "standby-elsewhere",
            Self::LaunchElsewhere => "launch-elsewhere",
            Self::Hold => "hold",
        }
    }
}

/// What was last seen of one component and the robot under it.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Evidence {
    /// Which component.
    pub component: ComponentKey,
    /// It moves a body.
    pub actuator: bool,
    /// A fault that happened since the last judgement (exit, hang, error, robot gone).
    pub fault: Option<Fault>,
    /// A standby on the same robot is ready.
    pub standby_here: bool,
    /// A standby on another robot is ready.
    pub standby_elsewhere: bool,
    /// Its own memory.
    pub memory: Bytes,
    /// Its own CPU, thousandths of one core.
    pub cpu: Permille,
    /// Its declared CPU need; zero when none was declared.
    pub cpu_limit: Permille,
    /// Deadlines of readers on this robot that its outputs missed so far; starts anew with
    /// each instance.
    pub deadlines_missed: u64,
    /// Deadlines that its inputs from other robots missed so far; likewise.
    pub inputs_late: u64,
    /// What programs of the operator's said last.
    pub told: Vec<Told>,
    /// Figures of the robot.
    pub robot: RobotEvidence,
}

/// What a program of the operator's says of one cause of a component.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Told {
    /// Which cause.
    pub cause: Cause,
    /// Whether it is so; `None` when nobody can tell.
    pub holds: Option<bool>,
    /// Why, for people.
    pub reason: String,
}

/// A program of the operator's that judges what a table cannot say ([`Recovery::programs`]).
#[derive(Clone, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
pub struct Program {
    /// A file of the robot's component path, and its arguments.
    pub command: Vec<String>,
    /// Time between two runs.
    pub every: Duration,
    /// It is ended when it takes longer.
    pub limit: Duration,
    /// What counts when it gives no answer.
    pub otherwise: Otherwise,
}

/// What counts when a program gives no answer.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Otherwise {
    /// Nobody can tell: raises nothing and clears nothing.
    Ignore,
    /// All its causes hold.
    Raise,
    /// None of its causes holds.
    Clear,
}

/// How long a component's execution thread may give no sign of life.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub enum HangLimit {
    /// So many of its periods, and never less than the agent's own least.
    Periods(u16),
    /// So long.
    Time(Duration),
}

/// One figure over several links.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Spread<T> {
    /// The least, which is the best for delay, jitter and loss.
    pub best: T,
    /// The one in the middle.
    pub median: T,
    /// The greatest.
    pub worst: T,
}

impl<T: Copy> Spread<T> {
    /// Of one link.
    pub fn of_one(value: T) -> Self {
        Self { best: value, median: value, worst: value }
    }
}

impl<T: Ord + Copy> Spread<T> {
    /// Over `values`; `None` when there are none.
    pub fn over(mut values: Vec<T>) -> Option<Self> {
        values.sort_unstable();
        let (best, worst) = (*values.first()?, *values.last()?);
        Some(Self { best, median: values[values.len() / 2], worst })
    }
}

/// Figures of the robot under a component.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct RobotEvidence {
    /// Capacity less measured use.
    pub memory_free: Option<Bytes>,
    /// CPU used, thousandths of the robot's capacity (1000 = all of it).
    pub cpu: Option<Permille>,
    /// Charge.
    pub battery: Option<Permille>,
    /// Radio level, one raw sample.
    pub rssi: Option<Dbm>,
    /// Half a round trip, over the links its connections use.
    pub delay: Option<Spread<Duration>>,
    /// Jitter, over those links.
    pub jitter: Option<Spread<Duration>>,
    /// Loss, over those links.
    pub loss: Option<Spread<Permille>>,
}

/// A fault as an event.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Fault {
    /// What is wrong.
    pub cause: Cause,
    /// With the exit status or the last output, for people.
    pub reason: String,
}

/// What a policy wants done for one component.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Verdict {
    /// Which component.
    pub component: ComponentKey,
    /// Why.
    pub cause: Cause,
    /// What to try.
    pub remedy: Remedy,
    /// With numbers: `rssi -54.8 dBm, bar -52.5 dBm, held 6.0 s`.
    pub reason: String,
    /// When the cause had held for its whole time.
    pub held_over_at: Instant,
}

/// How a cause stands, for people and recordings.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct CauseStatus {
    /// Which component.
    pub component: ComponentKey,
    /// What is being watched.
    pub cause: Cause,
    /// When it began to hold.
    pub since: Instant,
    /// How long it must hold.
    pub hold: Duration,
    /// Whether it is raised (held for its time, not yet cleared).
    pub raised: bool,
    /// With numbers.
    pub reason: String,
}

/// A cause that will send a component to another robot, should it hold for its whole time.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Foresight {
    /// Which component.
    pub component: ComponentKey,
    /// What holds, not yet for long enough.
    pub cause: Cause,
    /// What will be tried first.
    pub remedy: Remedy,
    /// How long it must hold in all.
    pub hold: Duration,
    /// With numbers.
    pub reason: String,
}

/// How fast a standby on another robot follows its home.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct GuardPolicy {
    /// Time between two beats of the home, at least 10 ms.
    pub period: Duration,
    /// Beats that may be missed on a good link; a lossy one may miss more.
    pub misses: u32,
    /// What the one that is left of two robots does: nobody can tell it whether the other one
    /// is gone or only unheard.
    pub alone: Alone,
}

impl Default for GuardPolicy {
    fn default() -> Self {
        Self { period: Duration::from_millis(50), misses: 4, alone: Alone::Promote }
    }
}

/// What came of a remedy.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub enum RemedyOutcome {
    /// It could not be done (no home fits, no standby is ready).
    Refused,
    /// It was done; whether it helps is seen from the evidence.
    Done,
}

/// Judges faults by a policy.
///
/// Holds the timers and the place on the ladder of each component; keeps no clock, no
/// channel and no log. Equal calls give equal answers.
pub trait Recovery {
    /// Looks at fresh evidence of all components of its system on this robot (for gone
    /// robots: at the coordinator) and says what should be done now.
    ///
    /// Called at each report (5 to 10 Hz), at each fault, and at [`Self::next_deadline`].
    fn judge(&mut self, now: Instant, evidence: &[Evidence]) -> Vec<Verdict>;

    /// Learns what came of a verdict.
    fn outcome(&mut self, now: Instant, component: &ComponentKey, outcome: RemedyOutcome);

    /// Forgets a component that left this robot or was undeployed.
    fn forget(&mut self, component: &ComponentKey);

    /// When `judge` should be called again at the latest.
    fn next_deadline(&self) -> Option<Instant>;

    /// Causes that hold now, raised or not yet.
    fn standing(&self) -> Vec<CauseStatus>;

    /// Components that will have to leave this robot unless what holds now ends in time: so
    /// that another robot can be made ready meanwhile.
    fn foreseen(&self) -> Vec<Foresight>;

    /// Whether the policy says what to do about `cause` of `component` at all.
    fn has_rule(&self, component: &ComponentKey, cause: Cause) -> bool;

    /// Whether `component` stays as it is until somebody resets it: an emergency stop of
    /// what moves a body.
    fn is_latched(&self, _component: &ComponentKey) -> bool {
        false
    }

    /// How long the execution thread of `component` may be silent; `None`: as the agent has
    /// it.
    fn hang_limit(&self, _component: &ComponentKey) -> Option<HangLimit> {
        None
    }

    /// The age of the last news at which the home of `component` counts as gone for it, when
    /// that is sooner than for the fleet.
    fn lost_after(&self, _component: &ComponentKey) -> Option<Duration> {
        None
    }

    /// Whether [`Self::lost_after`] says anything of any component.
    fn is_impatient(&self) -> bool {
        false
    }

    /// Programs that are to be asked about `component`, and for which causes; their answers
    /// are evidence.
    fn programs(&self, _component: &ComponentKey) -> Vec<(Program, Vec<Cause>)> {
        Vec::new()
    }

    /// Whether `cause` of `component` is an event rather than a figure over time: it stands
    /// until the component runs again.
    fn is_event(&self, _component: &ComponentKey, cause: Cause) -> bool {
        cause.is_event()
    }

    /// Why nothing should be placed on a robot with these figures now: a bar of its own rules
    /// that they are beyond already, with numbers. Facts that are unknown object to nothing.
    fn objection(&self, robot: &RobotEvidence) -> Option<(Cause, String)>;

    /// How long `component` must not come back to a robot that it left for a cause.
    fn not_back_for(&self, component: &ComponentKey) -> Duration;

    /// How fast standbys follow.
    fn guard(&self) -> GuardPolicy;
}
