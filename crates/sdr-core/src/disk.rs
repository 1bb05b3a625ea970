//! The bytes of what an agent must not forget.
//!
//! ```text
//!  "SDRSTATE" | version 4 | checksum 8 of the rest | StoredState in postcard
//! ```
//!
//! Numbers are little endian; the checksum is [`hash64`].

use alloc::vec::Vec;

use thiserror::Error;

use crate::{effect::StoredState, order::hash64};

const MAGIC: &[u8; 8] = b"SDRSTATE";
const VERSION: u32 = 1;
const HEADER_BYTES: usize = 20;

/// Why bytes are not a state. Nothing was changed; the operator may look at the file.
#[derive(Debug, Error)]
pub enum StateError {
    /// Not written by an agent.
    #[error("{found} bytes that do not begin with the state's mark")]
    Foreign {
        /// Length of the file.
        found: usize,
    },
    /// Written by another version.
    #[error("version {found}; this agent reads version {VERSION}")]
    Version {
        /// The version it says.
        found: u32,
    },
    /// Torn or flipped.
    #[error("checksum {found:016x}, the content has {expected:016x}")]
    Checksum {
        /// The checksum it says.
        found: u64,
        /// The checksum of what is there.
        expected: u64,
    },
    /// Whole, yet no state.
    #[error("content cannot be read: {0}")]
    Content(postcard::Error),
}

/// The bytes of `state`.
pub fn encode(state: &StoredState) -> Vec<u8> {
    seal(&postcard::to_allocvec(state).expect("writing plain data to memory cannot fail"))
}

/// A file with this content, whatever it says.
pub fn seal(content: &[u8]) -> Vec<u8> {
    let mut bytes = Vec::with_capacity(HEADER_BYTES + content.len());
    bytes.extend_from_slice(MAGIC);
    bytes.extend_from_slice(&VERSION.to_le_bytes());
    bytes.extend_from_slice(&hash64(content).to_le_bytes());
    bytes.extend_from_slice(content);
    bytes
}

/// Reads what [`encode`] wrote.
pub fn decode(bytes: &[u8]) -> Result<StoredState, StateError> {
    let foreign = StateError::Foreign { found: bytes.len() };
    let Some(rest) = bytes.strip_prefix(MAGIC) else { return Err(foreign) };
    let Some((version, rest)) = rest.split_first_chunk::<4>() else { return Err(foreign) };
    let Some((checksum, content)) = rest.split_first_chunk::<8>() else { return Err(foreign) };
    let version = u32::from_le_bytes(*version);
    if version != VERSION {
        return Err(StateError::Version { found: version });
    }
    let (found, expected) = (u64::from_le_bytes(*checksum), hash64(content));
    if found != expected {
        return Err(StateError::Checksum { found, expected });
    }
    postcard::from_bytes(content).map_err(StateError::Content)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_truncation_is_seen() {
        let bytes = encode(&StoredState { incarnation: 1 << 40, ..StoredState::default() });
        assert!(decode(&bytes).is_ok());
        for length in 0..bytes.len() {
            assert!(decode(&bytes[..length]).is_err(), "{length} of {} bytes", bytes.len());
        }
    }
}
