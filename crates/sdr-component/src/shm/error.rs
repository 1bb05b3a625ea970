//! What can go wrong with shared memory.

use std::fmt::Debug;
use std::path::PathBuf;

use thiserror::Error;

use super::{PAYLOAD_BYTES_MAX, PREFIX_BYTES_MAX, ROOT_BYTES_MAX};
use crate::protocol::SharedMemory;

/// Shared memory could not be used. Nothing was sent or received by the failed call.
#[derive(Clone, Debug, PartialEq, Eq, Error)]
#[non_exhaustive]
pub enum ShmError {
    /// The caller can mend it: shorter or other characters.
    #[error("`{0}` cannot be a name in shared memory")]
    Name(String),
    /// The operator can mend it.
    #[error("root path {} of the shared memory is longer than {ROOT_BYTES_MAX} bytes", root.display())]
    RootTooLong {
        /// As given.
        root: PathBuf,
    },
    /// The operator can mend it.
    #[error("prefix `{prefix}` of the shared memory is longer than {PREFIX_BYTES_MAX} bytes")]
    PrefixTooLong {
        /// As given.
        prefix: String,
    },
    /// No folder, no rights, no space, or too few file descriptors.
    #[error("cannot use the shared memory below {} with prefix `{prefix}`: {reason}", root.display())]
    Node {
        /// Where.
        root: PathBuf,
        /// Where.
        prefix: String,
        /// The library's word.
        reason: String,
    },
    /// A port could not be opened: too many users, or another program with other limits.
    #[error("cannot open port {path}: {reason}")]
    Port {
        /// The port.
        path: String,
        /// The library's word.
        reason: String,
    },
    /// The caller can mend it.
    #[error("a sample of {bytes} bytes on {path}; at most {PAYLOAD_BYTES_MAX}")]
    TooLarge {
        /// The port.
        path: String,
        /// What was asked for.
        bytes: usize,
    },
    /// No memory left, or too many loans at a time.
    #[error("no memory for a sample of {bytes} bytes on {path}: {reason}")]
    Loan {
        /// The port.
        path: String,
        /// What was asked for.
        bytes: usize,
        /// The library's word.
        reason: String,
    },
    /// The sample is lost.
    #[error("cannot send on {path}: {reason}")]
    Send {
        /// The port.
        path: String,
        /// The library's word.
        reason: String,
    },
    /// Too many samples held at a time, or the producer's memory is broken.
    #[error("cannot receive from {path}: {reason}")]
    Receive {
        /// The port.
        path: String,
        /// The library's word.
        reason: String,
    },
}

impl ShmError {
    pub(super) fn node(place: &SharedMemory, source: &impl Debug) -> Self {
        let root = place.root.clone();
        Self::Node { root, prefix: place.prefix.clone(), reason: format!("{source:?}") }
    }

    pub(super) fn port(path: &str, source: &impl Debug) -> Self {
        Self::Port { path: path.to_owned(), reason: format!("{source:?}") }
    }
}
