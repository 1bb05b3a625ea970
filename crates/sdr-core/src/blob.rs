//! Large values: bytes that records name by their hash, and that travel by themselves.
//!
//! A part of a system (a component with its parameters, a policy) that is longer than a record
//! stands in the fleet table as a [`BlobRef`]. Whoever reads of it fetches the bytes from a
//! robot that has them; until they are here the system is incomplete here.

use alloc::{sync::Arc, vec::Vec};
use core::fmt;

use serde::{Deserialize, Serialize};

/// Longest part of a system, bytes.
pub const PART_BYTES_MAX: usize = 1 << 20;
/// Most bytes that the large parts of one robot's fleet table may have, all together.
pub const PARTS_BYTES_MAX: usize = 64 << 20;

/// Names a blob: the BLAKE3 hash of its bytes.
#[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, Deserialize)]
pub struct BlobHash(pub [u8; 32]);

impl BlobHash {
    /// Of all bytes of a blob.
    pub fn of(bytes: &[u8]) -> Self {
        Self(*blake3::hash(bytes).as_bytes())
    }

    /// Reads 64 lower-case hexadecimal digits.
    pub fn parse(text: &str) -> Option<Self> {
        let lower = text.bytes().all(|byte| !byte.is_ascii_uppercase());
        blake3::Hash::from_hex(text).ok().filter(|_| lower).map(|hash| Self(*hash.as_bytes()))
    }
}

impl fmt::Display for BlobHash {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(blake3::Hash::from_bytes(self.0).to_hex().as_str())
    }
}

impl fmt::Debug for BlobHash {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "BlobHash({self})")
    }
}

/// What a record says of its value when it is too long for a record.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct BlobRef {
    /// Which bytes.
    pub hash: BlobHash,
    /// How many.
    pub length: u32,
}

impl BlobRef {
    /// The name of these bytes.
    pub fn of(bytes: &[u8]) -> Self {
        let length = u32::try_from(bytes.len()).unwrap_or(u32::MAX);
        Self { hash: BlobHash::of(bytes), length }
    }

    /// Whether these are the bytes it names.
    pub fn is_of(&self, bytes: &[u8]) -> bool {
        Self::of(bytes) == *self
    }

    /// Whether a part of a system may be so long.
    pub fn is_allowed(&self) -> bool {
        usize::try_from(self.length).is_ok_and(|length| length <= PART_BYTES_MAX)
    }
}

/// Bytes with their name, shared.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Blob {
    /// Their name.
    pub hash: BlobHash,
    /// All of them.
    pub bytes: Arc<Vec<u8>>,
}

#[cfg(test)]
mod tests {
    use alloc::string::ToString as _;

    use super::*;

    #[test]
    fn a_hash_is_read_back_and_anything_else_is_none() {
        let hash = BlobHash::of(b"some bytes");
        assert_eq!(BlobHash::parse(&hash.to_string()), Some(hash));
        for word in ["", "12", &"g".repeat(64), &"A".repeat(64), &"a".repeat(65)] {
            assert_eq!(BlobHash::parse(word), None, "{word}");
        }
    }

    #[test]
    fn bytes_answer_to_their_own_name_only() {
        let name = BlobRef::of(b"some bytes");
        assert!(name.is_of(b"some bytes"));
        assert!(!name.is_of(b"some byte"));
        assert!(!BlobRef { length: 9, ..name }.is_of(b"some bytes"));
    }
}
