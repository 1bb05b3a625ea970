//! The simulator.

mod air;
mod chance;
pub mod check;
mod clock;
mod disk;
mod fault;
mod fleet;
mod flow;
mod measure;
mod plain;
mod process;
mod queue;
mod record;
mod robot;
mod run;
mod shell;
mod sight;
pub mod systems;
mod tally;
mod trace;
mod truth;
mod watch;

pub use air::{FRAME_BYTES, Way, Weather, address};
pub use chance::Chance;
pub use fault::{ClockFate, DiskFate, Fault, Incident};
pub use fleet::{ActiveProcess, Fleet, Setup};
pub use plain::Plain;
pub use process::{Behaviour, Process};
pub use record::{Figures, Rate, Record, Spread};
pub use robot::Robot;
pub use sight::Sight;
pub use tally::Tally;
pub use truth::table_hash;
pub use watch::{Broken, Checker, Violation, Watch};
