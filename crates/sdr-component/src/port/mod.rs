//! Typed ports: loan, fill, stamp, send; receive, check the token, hand over.
//!
//! ```text
//!  OutPort::send ─▶ shm ─▶ Connection: whole? token not older? ─▶ queue ─▶ InPort::receive
//!                              │ counts accepted, lost, fenced, late, gaps
//!                              └ a greater token ─▶ `heard`
//! ```
//!
//! Samples are judged when they arrive, by the execution thread, also between the ticks of a
//! periodic component, so that the figures show the stream and not the reader's rate.

mod connection;
mod fence;
mod in_port;
mod out_port;
mod statistics;

use thiserror::Error;

pub(crate) use connection::Connection;
pub use fence::{Fence, Passage};
pub use in_port::{InPort, Received};
pub(crate) use in_port::{InputCore, SharedInput};
pub use out_port::OutPort;
pub(crate) use out_port::{OutputCore, SharedOutput};
pub use statistics::Statistics;

use crate::{message::CdrError, shm::ShmError};

/// A sample could not be sent or read.
#[derive(Clone, Debug, PartialEq, Eq, Error)]
#[non_exhaustive]
pub enum PortError {
    /// Only active instances write. Nothing was sent.
    #[error("output `{port}` is silent: the component is not active")]
    Inactive {
        /// The output.
        port: String,
    },
    /// The shared memory refused.
    #[error(transparent)]
    Memory(#[from] ShmError),
    /// Not the message that the port carries, or one that does not fit its own length.
    #[error("{port}: not a {message_type}: {source}")]
    Message {
        /// The port.
        port: String,
        /// What it carries.
        message_type: &'static str,
        /// Where it went wrong.
        source: CdrError,
    },
}

#[cfg(test)]
mod tests;
