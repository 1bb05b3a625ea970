//! The simulator: the very brains of the agents in virtual time, on one thread.
//!
//! ```text
//!  Scenario (drawn) ─┐  faults, operators
//!  Plain (figures) ──┴─▶ Run ─▶ Fleet ── handle / poll_effect ──▶ Brain of each robot
//!                         │       ├─ Queue: what is due, by (time, sequence)
//!                         │       ├─ Air: loss, delay, cuts     ├─ Disk, Clock, Process
//!                         │       └─ Sight: what truly happened
//!                         ├─▶ Watch: checkers, one rule each, which only look ─▶ violations
//!                         └─▶ Measure ─▶ Record ─▶ Figures
//! ```
//!
//! One seed draws everything; nothing here reads a clock but [`Record::real_s`]. Equal seeds
//! give equal traces. `docs/simulator.md` says what is drawn, what is checked and how each
//! figure is defined.

mod air;
mod chance;
mod chaos;
pub mod check;
mod clock;
mod disk;
mod draw;
mod due;
mod edition;
mod fault;
mod fetch;
mod fleet;
mod flow;
mod measure;
mod operators;
mod plain;
mod pool;
mod process;
mod queue;
mod record;
mod robot;
mod run;
mod setup;
mod shell;
mod shrink;
mod sight;
mod story;
mod survive;
pub mod systems;
mod tally;
mod trace;
mod truth;
mod watch;
mod words;

pub use air::{FRAME_BYTES, Way, Weather, address};
pub use chance::Chance;
pub use chaos::{CONVERGED_WITHIN, Outcome, Telling};
pub use draw::Scenario;
pub use fault::{ClockFate, DiskFate, Fault, Incident};
pub use fleet::{ActiveProcess, Fleet, Probe};
pub use plain::Plain;
pub use process::{Behaviour, Process};
pub use record::{Figures, Rate, Record, Spread};
pub use robot::{MakeRecovery, Robot};
pub use setup::Setup;
pub use shrink::{Shrunk, fair_weather, shrink};
pub use sight::Sight;
pub use story::story;
pub use tally::Tally;
pub use truth::same_table;
pub use watch::{Broken, Checker, Violation, Watch};
