//! Conditions, ladders, and what to try next.
//!
//! ```text
//!   evidence ──▶ condition ──▶ sustain ──▶ climb ──▶ verdict
//!   (figures,    at the bar?   for long    which     to the brain;
//!    faults)                   enough?     rung?     the outcome comes back
//!
//!                 hold                 stop trying, say so
//!                 ────
//!              launch-elsewhere        ask again, ever slower, until a home is found
//!              ────────────────
//!           standby-elsewhere          if one is ready
//!           ─────────────────
//!        restart                       three times, each after a longer pause
//!        ───────
//!     local-standby                    if one is ready here
//!     ─────────────
//!  fault ──▶ up one rung whenever the last one did not help within its settling time
//!       ◀── back at the bottom once it did
//! ```
//!
//! A [`Policy`] says which cause climbs which ladder; the default is the paper's Table III.
//! An [`Engine`] holds the timers and the place of each component on its ladder. It has no
//! clock: equal calls give equal answers, and calling it more often than its
//! `next_deadline` changes nothing.
//!
//! - A verdict is given once for each order, then the engine waits for its outcome. Done: the
//!   fault must stay away for the settling time. Refused: the next rung; only a launch
//!   elsewhere is asked for again, after 1 s, 2 s, 4 s, up to 30 s: for ever when the robot is
//!   ill or gone, eight times when the component is.
//! - A cause whose ladder begins with a more severe rung takes over a climb; a milder one
//!   waits. Within a climb nobody goes down.
//! - Causes of the robot that leave it at once (`elsewhere`) give verdicts for all components
//!   in one call. Those that are first met here (`local-first`) take one component after the
//!   other, the largest first.
//! - Rungs whose budget of the hour is spent are passed over. A component that is held for a
//!   spent budget is tried again when there is room; one that is held for a condition, when
//!   the condition is over; one that is held for a fault, when it was forgotten
//!   ([`sdr_core::recover::Recovery::forget`]: reset, redeployed) or fails anew later than the
//!   settling time; one that a ladder of nothing but `hold` stopped, only when forgotten.
//! - What nobody knows raises nothing and clears nothing.
//!
//! ```
//! use sdr_core::{
//!     id::{ComponentKey, Name},
//!     recover::{Cause, Evidence, Fault, Recovery, Remedy, RobotEvidence},
//!     time::{Duration, Instant},
//!     units::{Bytes, Permille},
//! };
//! use sdr_recovery::{Engine, Policy};
//!
//! let mut engine = Engine::new(Policy::default());
//! let name = |word| Name::new(word).unwrap();
//! let verdicts = engine.judge(Instant::ZERO, &[Evidence {
//!     component: ComponentKey::new(&name("exploration"), &name("camera")),
//!     actuator: false,
//!     fault: Some(Fault { cause: Cause::Exited, reason: "signal 9".into() }),
//!     standby_here: false,
//!     standby_elsewhere: false,
//!     memory: Bytes::mega(530),
//!     cpu: Permille(200),
//!     cpu_limit: Permille(0),
//!     deadlines_missed: 0,
//!     inputs_late: 0,
//!     told: vec![],
//!     robot: RobotEvidence::default(),
//! }]);
//!
//! assert_eq!(verdicts[0].remedy, Remedy::Restart { after: Duration::ZERO });
//! assert_eq!(verdicts[0].reason, "signal 9; restart 1 of 3");
//! ```
#![no_std]
#![forbid(unsafe_code)]

extern crate alloc;

mod condition;
mod expression;
mod fact;
mod ladder;
mod level;
mod policy;
mod policy_error;
mod table_iii;
mod wire;

mod counts;
mod smooth;
mod sustain;
mod tally;

mod budget;
mod climb;
mod watch;

mod engine;
mod explain;
mod group;

pub use condition::{Bar, Clear, Condition, RSSI_MEDIAN_OVER};
pub use engine::{Engine, make};
pub use explain::{Explained, ExplainedComponent, ExplainedRule, explain};
pub use expression::{
    DEPTH_MAX, Expression, ExpressionError, Kind, NODES_MAX, Named, SOURCE_BYTES_MAX, names,
};
pub use fact::{Fact, Over};
pub use ladder::{Backoff, Ladder, LadderError, RUNGS_MAX, Restart, Rung};
pub use level::{Level, Unit};
pub use policy::{
    EVERY_MIN, Exception, HANG_MIN, LADDERS_MAX, LOST_MIN, Limits, MEDIAN_OVER_MAX, PER_MAX,
    Policy, PolicyParts, RULES_MAX, Return, Rule, Trigger,
};
pub use policy_error::PolicyError;
pub use wire::POLICY_VERSION;
