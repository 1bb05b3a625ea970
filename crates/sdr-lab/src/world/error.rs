//! What a world cannot do.

use std::io;
use std::path::PathBuf;

/// A world was asked for something it cannot do; nothing changed.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum WorldError {
    /// Too few or too many robots.
    #[error("{found} robots, allowed are 1 to {allowed}")]
    RobotsCount {
        /// How many.
        found: usize,
        /// At most.
        allowed: usize,
    },
    /// A name that cannot be a folder's.
    #[error("robot name `{name}`: allowed are letters, digits, `-` and `_`, at least one")]
    Name {
        /// The name.
        name: String,
    },
    /// Two robots of one name.
    #[error("two robots are named `{name}`")]
    Twice {
        /// The name.
        name: String,
    },
    /// No robot of that name.
    #[error("no robot `{name}` in this world")]
    UnknownRobot {
        /// The name.
        name: String,
    },
    /// A rover keeps station at one that itself keeps station.
    #[error("robot `{name}` cannot lead: it keeps station itself")]
    Leader {
        /// The name.
        name: String,
    },
    /// The system allows no socket there.
    #[error(
        "{} has {found} bytes, a socket's path at most {allowed}: take a shorter folder",
        path.display()
    )]
    PathLong {
        /// The path.
        path: PathBuf,
        /// Its length.
        found: usize,
        /// The system's bound.
        allowed: usize,
    },
    /// A number that makes no sense.
    #[error("{name} is {value}, allowed are {allowed}")]
    OutOfRange {
        /// Which number.
        name: &'static str,
        /// The number.
        value: f64,
        /// From where to where.
        allowed: &'static str,
    },
    /// A folder, socket, file or thread could not be made.
    #[error("{}: {source}", path.display())]
    Io {
        /// Which.
        path: PathBuf,
        /// What the system said.
        source: io::Error,
    },
}
