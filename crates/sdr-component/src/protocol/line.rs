//! Lines out of a stream of bytes, with a bound.

use serde::{Serialize, de::DeserializeOwned};
use thiserror::Error;

/// Longest line of a component, its end included, bytes.
pub const LINE_BYTES_MAX: usize = 64 * 1024;
/// Longest line of an agent: `configure` carries all parameters.
pub const AGENT_LINE_BYTES_MAX: usize = 8 << 20;

/// Why a line cannot be used. The connection it came on is of no more use.
#[derive(Debug, Error)]
pub enum LineError {
    /// Too long; nothing after it was looked at.
    #[error("a line is longer than {allowed} bytes")]
    TooLong {
        /// Longest one from that side.
        allowed: usize,
    },
    /// Not one of the messages.
    #[error("line {number}: {source}; it begins with `{beginning}`")]
    Malformed {
        /// Counts the lines of the connection, from 1.
        number: u64,
        /// What the parser says.
        source: serde_json::Error,
        /// The first 80 characters, printable.
        beginning: String,
    },
}

/// One message of a component as a line, its end included.
///
/// Fails only with [`LineError::TooLong`]: the messages have string keys throughout.
pub fn encode_line<T: Serialize>(message: &T) -> Result<Vec<u8>, LineError> {
    encode(message, LINE_BYTES_MAX)
}

/// One message of an agent as a line; as [`encode_line`].
pub fn encode_agent_line<T: Serialize>(message: &T) -> Result<Vec<u8>, LineError> {
    encode(message, AGENT_LINE_BYTES_MAX)
}

fn encode<T: Serialize>(message: &T, allowed: usize) -> Result<Vec<u8>, LineError> {
    let mut line = serde_json::to_vec(message).map_err(|source| LineError::Malformed {
        number: 0,
        source,
        beginning: String::new(),
    })?;
    line.push(b'\n');
    if line.len() > allowed { Err(LineError::TooLong { allowed }) } else { Ok(line) }
}

/// Keeps what came until its line is whole; at most the longest line and one read's worth.
#[derive(Debug)]
pub struct LineBuffer {
    allowed: usize,
    bytes: Vec<u8>,
    searched: usize,
    number: u64,
}

impl Default for LineBuffer {
    /// For the lines of a component.
    fn default() -> Self {
        Self { allowed: LINE_BYTES_MAX, bytes: Vec::new(), searched: 0, number: 0 }
    }
}

impl LineBuffer {
    /// For the lines of an agent.
    pub fn of_agent() -> Self {
        Self { allowed: AGENT_LINE_BYTES_MAX, ..Self::default() }
    }

    /// Takes bytes as they came.
    pub fn push(&mut self, bytes: &[u8]) {
        self.bytes.extend_from_slice(bytes);
    }

    /// The next message, or `None` until more bytes came. Empty lines are skipped.
    ///
    /// After an error the connection should be closed; the buffer is not usable any more.
    pub fn next_message<T: DeserializeOwned>(&mut self) -> Result<Option<T>, LineError> {
        loop {
            let Some(line) = self.next_line()? else { return Ok(None) };
            if line.iter().all(u8::is_ascii_whitespace) {
                continue;
            }
            return match serde_json::from_slice(&line) {
                Ok(message) => Ok(Some(message)),
                Err(source) => Err(LineError::Malformed {
                    number: self.number,
                    source,
                    beginning: beginning(&line),
                }),
            };
        }
    }

    /// The next whole line without its end.
    fn next_line(&mut self) -> Result<Option<Vec<u8>>, LineError> {
        let fresh = &self.bytes[self.searched..];
        match fresh.iter().position(|&byte| byte == b'\n') {
            Some(offset) => {
                let end = self.searched + offset;
                if end >= self.allowed {
                    return Err(LineError::TooLong { allowed: self.allowed });
                }
                let rest = self.bytes.split_off(end + 1);
                let mut line = std::mem::replace(&mut self.bytes, rest);
                line.pop();
                self.searched = 0;
                self.number += 1;
                Ok(Some(line))
            }
            None if self.bytes.len() >= self.allowed => {
                Err(LineError::TooLong { allowed: self.allowed })
            }
            None => {
                self.searched = self.bytes.len();
                Ok(None)
            }
        }
    }
}

fn beginning(line: &[u8]) -> String {
    String::from_utf8_lossy(line).chars().take(80).flat_map(char::escape_default).collect()
}
