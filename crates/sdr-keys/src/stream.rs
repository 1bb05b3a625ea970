//! What robots say to each other over streams: one request and one answer each.
//!
//! ```text
//! request   1 version  kind 1: hash 32, offset 8      a blob from an offset
//!                      kind 2: key 2                  the mesh key, if newer than this one
//! answer    1 status   0: kind 1: length 8, then bytes from the offset to the end
//!                         kind 2: a [`crate::Delivery`] as JSON
//!                      others: see [`Status`]; nothing follows
//! ```
//!
//! Numbers are big-endian. The request ends the sender's half of the stream.

use thiserror::Error;

use crate::mesh_key::KeyId;

/// The application protocol's name in the handshake.
pub const PROTOCOL: &[u8] = b"sdr-stream/1";
/// Longest request, bytes.
pub const REQUEST_BYTES_MAX: usize = 42;
/// Longest answer to [`Request::Key`], bytes.
pub const DELIVERY_BYTES_MAX: usize = 6 << 20;
const VERSION: u8 = 1;

/// One request.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Request {
    /// The bytes of a blob from an offset on.
    Blob {
        /// BLAKE3 of all its bytes.
        hash: [u8; 32],
        /// Bytes that the asker has.
        offset: u64,
    },
    /// The newest mesh key.
    Key {
        /// The newest that the asker has.
        have: KeyId,
    },
}

/// How an answer begins.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Status {
    /// What was asked for follows.
    Here,
    /// It is not here.
    Absent,
    /// The offset is behind the end.
    Offset,
    /// The request cannot be read.
    Unknown,
}

/// Why a request is not one. The peer is to blame.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Error)]
pub enum RequestError {
    /// No version that is spoken here.
    #[error("version {0}; this robot speaks {VERSION}")]
    Version(u8),
    /// A kind that is not known here.
    #[error("unknown kind {0}")]
    Kind(u8),
    /// Too short or too long for its kind.
    #[error("{0} bytes are not what that kind has")]
    Length(usize),
}

impl Request {
    /// Its bytes.
    pub fn encode(&self) -> Vec<u8> {
        let mut bytes = vec![VERSION];
        match self {
            Self::Blob { hash, offset } => {
                bytes.push(1);
                bytes.extend(hash);
                bytes.extend(offset.to_be_bytes());
            }
            Self::Key { have } => {
                bytes.push(2);
                bytes.extend(have.0.to_be_bytes());
            }
        }
        bytes
    }

    /// Reads all of `bytes`.
    pub fn decode(bytes: &[u8]) -> Result<Self, RequestError> {
        let wrong = RequestError::Length(bytes.len());
        let [version, kind, body @ ..] = bytes else { return Err(wrong) };
        if *version != VERSION {
            return Err(RequestError::Version(*version));
        }
        match kind {
            1 => {
                let (hash, offset) = body.split_at_checked(32).ok_or(wrong)?;
                Ok(Self::Blob {
                    hash: hash.try_into().expect("32 bytes"),
                    offset: u64::from_be_bytes(offset.try_into().map_err(|_| wrong)?),
                })
            }
            2 => {
                let have = body.try_into().map_err(|_| wrong)?;
                Ok(Self::Key { have: KeyId(u16::from_be_bytes(have)) })
            }
            other => Err(RequestError::Kind(*other)),
        }
    }
}

impl Status {
    /// Its byte.
    pub fn byte(self) -> u8 {
        match self {
            Self::Here => 0,
            Self::Absent => 1,
            Self::Offset => 2,
            Self::Unknown => 3,
        }
    }

    /// The status of that byte; what is not known here counts as [`Status::Unknown`].
    pub fn of_byte(byte: u8) -> Self {
        [Self::Here, Self::Absent, Self::Offset]
            .into_iter()
            .find(|status| status.byte() == byte)
            .unwrap_or(Self::Unknown)
    }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    proptest! {
        #[test]
        fn requests_are_read_back_and_garbage_is_refused(
            hash in any::<[u8; 32]>(), offset in any::<u64>(), have in any::<u16>(),
            garbage in prop::collection::vec(any::<u8>(), 0..60),
        ) {
            for request in [Request::Blob { hash, offset }, Request::Key { have: KeyId(have) }] {
                let bytes = request.encode();
                prop_assert!(bytes.len() <= REQUEST_BYTES_MAX);
                prop_assert_eq!(Request::decode(&bytes), Ok(request));
                prop_assert!(Request::decode(&bytes[..bytes.len() - 1]).is_err());
            }
            if let Ok(request) = Request::decode(&garbage) {
                prop_assert_eq!(request.encode(), garbage);
            }
        }
    }
}
