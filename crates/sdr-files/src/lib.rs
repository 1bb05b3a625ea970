//! The files people write: robot.toml, systems, policies and scenarios; read whole, checked, with a
//! place for every error.
//!
//! ```text
//!  text ──▶ tree (nodes with marks) ──▶ read (typed file) ──▶ checked type
//!             syntax, duplicates         keys, units            RobotConfig, LoadedSystem,
//!                     └────────────────────┴── Problems ──────▶ three policies
//! ```
//!
//! Every problem has file, line and column, says what was found and what is allowed, and
//! as many as possible are told at once. The types that the files are read into are also
//! the source of the JSON schemas ([`schema`]).
//!
//! ```
//! let text = "system: s\ncomponents:\n  eye: { run: { native: camera }, rat: 15Hz }\n";
//! let problems = sdr_files::parse_system("s.yaml", text, ".".as_ref()).unwrap_err();
//! let first = problems.to_string();
//! assert!(first.starts_with("s.yaml:3:35: unknown key `rat`; allowed: run, needs, rate"));
//! assert!(first.contains("(did you mean `rate`?)"));
//! ```
#![forbid(unsafe_code)]

mod kind;
mod near;
mod policy;
pub mod problem;
mod read;
mod tree;
pub mod units;

pub mod robot;
pub mod scenario;
pub mod schema;
mod system;

pub use kind::{FileKind, LoadedFile, detect, load_any};
pub use policy::{
    load_allocation, load_recovery, load_role, parse_allocation, parse_recovery, parse_role,
    role_text,
};
pub use problem::{Problem, Problems};
pub use robot::{RobotConfig, load_robot};
pub use scenario::{Scenario, load_scenario, parse_scenario};
pub use system::{LoadedSystem, link_profiles, load_system, parse_system};
