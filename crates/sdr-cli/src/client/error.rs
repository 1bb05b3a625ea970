//! Why there is no answer, in words that say what to do next.

use std::{fmt::Display, io};

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
        "no agent at {agent} ({source})\n  The agent is not running here.  Start it:   sudo systemctl start sdr-agent\n  Or ask another one on this machine:         sdr --agent SOCKET ..."
    )]
    Absent {
        /// Where it was looked for.
        agent: String,
        /// What the system said.
        source: io::Error,
    },
    /// The socket belongs to others; the operator joins their group.
    #[error(
        "the agent at {agent} may not be asked by this user\n  Its socket is open to its own user and group.  Join the group:   sudo usermod -aG sdr $USER"
    )]
    Denied {
        /// The agent that was asked.
        agent: String,
    },
    /// Nobody listens at another robot's address.
    #[error(
        "no agent at {agent} ({source})\n  It is off, out of reach, or its robot.toml has no [api] listen with this port."
    )]
    Unreachable {
        /// Where it was looked for.
        agent: String,
        /// What the system said.
        source: io::Error,
    },
    /// One end refused the other's certificate.
    #[error("{agent}: {reason}")]
    Unwelcome {
        /// The agent that was asked.
        agent: String,
        /// Which end refused whom, and why.
        reason: String,
    },
    /// Connected, then nothing.
    #[error(
        "the agent at {agent} did not answer {path} within {seconds} s\n  It is stopped or overloaded; its log says more."
    )]
    Silent {
        /// The agent that was asked.
        agent: String,
        /// What was asked.
        path: String,
        /// How long it had.
        seconds: f64,
    },
    /// The connection ended or carried no HTTP.
    #[error(
        "no usable answer from {agent} to {path}: {reason}\n  The agent ended meanwhile, or that is no agent's socket."
    )]
    Broken {
        /// The agent that was asked.
        agent: String,
        /// What was asked.
        path: String,
        /// What went wrong.
        reason: String,
    },
    /// HTTP, but not what was expected.
    #[error(
        "the answer from {agent} to {path} cannot be read: {reason}\n  It begins: {start}\n  Are sdr and sdr-agent of one version?   sdr --version; sdr-agent --version"
    )]
    Nonsense {
        /// The agent that was asked.
        agent: String,
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
        let agent = client.agent();
        Self::Nonsense { agent, path: path.into(), reason: reason.to_string(), start }
    }
}

impl From<ClientError> for Failure {
    fn from(error: ClientError) -> Self {
        match error {
            ClientError::Refused { answer, .. } => Self::Failed(answer),
            ClientError::Absent { .. }
            | ClientError::Denied { .. }
            | ClientError::Unreachable { .. }
            | ClientError::Unwelcome { .. }
            | ClientError::Silent { .. }
            | ClientError::Broken { .. }
            | ClientError::Nonsense { .. }
            | ClientError::TooLarge { .. }
            | ClientError::Request { .. } => Self::new(error.to_string()),
        }
    }
}
