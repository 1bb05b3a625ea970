//! What can go wrong with a device.

use std::io;
use std::path::PathBuf;

/// A device did not do what it was asked. The client is of no more use unless said otherwise:
/// connect again.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum DeviceError {
    /// Nobody answers at that path.
    #[error("no device at {}: {source}", path.display())]
    Absent {
        /// The socket.
        path: PathBuf,
        /// What the system said.
        source: io::Error,
    },
    /// The device is there and is not the one wanted.
    #[error("{} is not {wanted}: it says {found}", path.display())]
    Unexpected {
        /// The socket.
        path: PathBuf,
        /// What was wanted.
        wanted: &'static str,
        /// The beginning of what it says.
        found: String,
    },
    /// Nothing came in time. The client stays usable if it streams (wheels).
    #[error("device silent for {waited_ms} ms")]
    Silent {
        /// How long, milliseconds.
        waited_ms: u128,
    },
    /// The device takes no more for the moment; the client stays usable.
    #[error("device busy: it takes no more commands for the moment")]
    Busy,
    /// A value that no command may have; nothing was sent, the client stays usable.
    #[error("{name} is {value}, allowed are {allowed}")]
    OutOfRange {
        /// Which number.
        name: &'static str,
        /// The number.
        value: f64,
        /// From where to where.
        allowed: &'static str,
    },
    /// The device refused and said why; the client stays usable.
    #[error("device refused: {reason}")]
    Refused {
        /// Its words.
        reason: String,
    },
    /// What came is not the protocol.
    #[error("device says {found}, expected {expected}")]
    Garbled {
        /// The beginning of what it says.
        found: String,
        /// What would have been right.
        expected: &'static str,
    },
    /// The connection broke.
    #[error("connection to the device broke: {0}")]
    Broken(#[from] io::Error),
}

impl DeviceError {
    /// The device hung up.
    pub(crate) fn hung_up() -> Self {
        Self::Broken(io::Error::new(io::ErrorKind::UnexpectedEof, "it hung up"))
    }

    /// The line is not the protocol; long ones are cut.
    pub(crate) fn garbled(line: &[u8], expected: &'static str) -> Self {
        Self::Garbled { found: beginning(line), expected }
    }
}

/// The first 80 characters, printable.
pub(crate) fn beginning(line: &[u8]) -> String {
    String::from_utf8_lossy(line).chars().take(80).flat_map(char::escape_default).collect()
}
