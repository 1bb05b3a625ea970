//! Why there is no answer, in words that say what to do next.

use std::{fmt::Display, io, path::PathBuf};

use sdr_core::api::ErrorAnswer;
use thiserror::Error;

use super::Client;
use crate::failure::Failure;

/// Most characters of a strange answer that are shown.
const SHOWN_MAX: usize = 60;

/// A request that brought no usable answer.
#[derive(Debug, Error)]
pub(crate) enum ClientError {
    /// Nobody listens; the operator starts an agent or names another.
    #[error(
        "no agent at {} ({source})\n  The agent is not running here.  Start it:   sudo systemctl start sdr-agent\n  Or ask another one on this machine:         sdr --agent SOCKET ...",
        socket.display()
    )]
    Absent {
        /// Where it was looked for.
        socket: PathBuf,
        /// What the system said.
        source: io::Error,
    },
    /// The socket belongs to others; the operator joins their group.
    #[error(
        "the agent at {} may not be asked by this user\n  Its socket is open to its own user and group.  Join the group:   sudo usermod -aG sdr $USER",
        socket.display()
    )]
    Denied {
        /// The socket.
        socket: PathBuf,
    },
    /// Connected, then nothing.
    #[error(
        "the agent at {} did not answer {path} within {seconds} s\n  It is stopped or overloaded; its log says more.",
        socket.display()
    )]
    Silent {
        /// The socket.
        socket: PathBuf,
        /// What was asked.
        path: String,
        /// How long it had.
        seconds: f64,
    },
    /// The connection ended or carried no HTTP.
    #[error(
        "no usable answer from {} to {path}: {reason}\n  The agent ended meanwhile, or that is no agent's socket.",
        socket.display()
    )]
    Broken {
        /// The socket.
        socket: PathBuf,
        /// What was asked.
        path: String,
        /// What went wrong.
        reason: String,
    },
    /// HTTP, but not what was expected.
    #[error(
        "the answer from {} to {path} cannot be read: {reason}\n  It begins: {start}\n  Are sdr and sdr-agent of one version?   sdr --version; sdr-agent --version",
        socket.display()
    )]
    Nonsense {
        /// The socket.
        socket: PathBuf,
        /// What was asked.
        path: String,
        /// What does not fit.
        reason: String,
        /// The first characters.
        start: String,
    },
    /// An answer beyond all measure.
    #[error("the answer to {path} is larger than {limit} MiB")]
    TooLarge {
        /// What was asked.
        path: String,
        /// The bound, MiB.
        limit: usize,
    },
    /// The agent said no, with a reason.
    #[error("{}", answer.error)]
    Refused {
        /// HTTP status.
        status: u16,
        /// The reason.
        answer: ErrorAnswer,
    },
    /// The request cannot even be written: our own error.
    #[error("the request cannot be written: {reason}")]
    Request {
        /// What went wrong.
        reason: String,
    },
}

impl ClientError {
    /// An answer that is no JSON of the expected shape.
    pub(super) fn nonsense(client: &Client, path: &str, reason: impl Display, body: &[u8]) -> Self {
        let text = String::from_utf8_lossy(body);
        let shown = text.chars().take(SHOWN_MAX).map(|c| if c.is_control() { '.' } else { c });
        let start = match body.is_empty() {
            true => "(nothing)".into(),
            false => shown.collect(),
        };
        let socket = client.socket().to_path_buf();
        Self::Nonsense { socket, path: path.into(), reason: reason.to_string(), start }
    }
}

impl From<ClientError> for Failure {
    fn from(error: ClientError) -> Self {
        match error {
            ClientError::Refused { answer, .. } => Self::Failed(answer),
            ClientError::Absent { .. }
            | ClientError::Denied { .. }
            | ClientError::Silent { .. }
            | ClientError::Broken { .. }
            | ClientError::Nonsense { .. }
            | ClientError::TooLarge { .. }
            | ClientError::Request { .. } => Self::new(error.to_string()),
        }
    }
}
