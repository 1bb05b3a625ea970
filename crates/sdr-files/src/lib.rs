//! The files people write: robot.toml, systems and policies; read whole, checked, with a
//! place for every error.
//!
//! ```text
//!  text ──▶ tree (nodes with marks) ──▶ read (typed file) ──▶ checked type
//!             syntax, duplicates         keys, units            RobotConfig, LoadedSystem,
//!                     └────────────────────┴── Problems ──────▶ two policies
//! ```
//!
//! Every problem has file, line and column, says what was found and what is allowed, and
//! as many as possible are told at once. The types that the files are read into are also
//! the source of the JSON schemas ([`schema`]).
#![forbid(unsafe_code)]

mod near;
mod policy;
pub mod problem;
mod read;
mod tree;
pub mod units;

pub mod robot;
mod system;

pub use policy::{load_allocation, load_recovery};
pub use problem::{Problem, Problems};
pub use robot::{RobotConfig, load_robot};
pub use system::{LoadedSystem, link_profiles, load_system, parse_system};
