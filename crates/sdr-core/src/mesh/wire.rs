//! The datagram: header, then sections of (tag, length, body). Version 1.
//!
//! ```text
//! 0  "SD"            2  magic
//! 2  version         1  1
//! 3  fleet           4  FNV-1a of the fleet's name, folded, little endian
//! 7  sender          1 + n (n <= 32)
//!    incarnation     8 + 4   counter, nonce
//!    sections:       tag 1, length 2, body (postcard)
//! ```
//!
//! Unknown tags are skipped, so that version N-1 lives with N. Any bytes at all are
//! answered with a value or an error, never a panic.

use alloc::{string::String, vec::Vec};
use core::net::SocketAddr;

use serde::{Deserialize, Serialize};
use thiserror::Error;

use super::{Incarnation, fleet_table::FleetRecord};
use crate::id::{NAME_BYTES_MAX, RobotId};

/// Longest datagram, so that no common link fragments it.
pub const DATAGRAM_BYTES_MAX: usize = 1200;
const MAGIC: [u8; 2] = *b"SD";
const VERSION: u8 = 1;

/// Why a datagram was dropped.
#[derive(Clone, Debug, PartialEq, Eq, Error)]
pub enum WireError {
    /// Longer than [`DATAGRAM_BYTES_MAX`].
    #[error("{0} bytes; a datagram has at most {DATAGRAM_BYTES_MAX}")]
    TooLong(usize),
    /// Ends in the middle of something.
    #[error("cut short at byte {0}")]
    Short(usize),
    /// Not ours.
    #[error("no mesh datagram")]
    Magic,
    /// A version this agent does not speak.
    #[error("version {0}; this agent speaks {VERSION}")]
    Version(u8),
    /// Another fleet's.
    #[error("of another fleet")]
    Foreign,
    /// A section whose body is not what its tag says, or a name that is none.
    #[error("section {0} cannot be read")]
    Body(u8),
}

/// One datagram.
#[derive(Clone, Debug, PartialEq)]
pub struct Datagram {
    /// Which fleet.
    pub fleet: u32,
    /// Who sent it.
    pub from: RobotId,
    /// Under which incarnation.
    pub incarnation: Incarnation,
    /// What it says.
    pub sections: Vec<Section>,
}

/// One part of a datagram.
#[derive(Clone, Debug, PartialEq)]
pub enum Section {
    /// Asks for a [`Section::Pong`] with the same number.
    Ping(u16),
    /// Answers a ping.
    Pong(u16),
    /// What the sender holds of each author.
    AuthorDigest(AuthorDigest),
    /// Records of one author that the receiver lacks.
    AuthorDelta(AuthorDelta),
    /// One hash per bucket of the fleet table.
    FleetDigest(Vec<u32>),
    /// What the sender holds in part of one bucket.
    FleetBucket(FleetBucket),
    /// Records of the fleet table.
    FleetRecords(Vec<FleetRecord>),
    /// Where some robots can be reached.
    Peers(Vec<SocketAddr>),
}

/// How far the sender's knowledge of one author goes.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct AuthorStamp {
    /// The author.
    pub robot: RobotId,
    /// Its incarnation.
    pub incarnation: Incarnation,
    /// Its heartbeat counter.
    pub heartbeat: u64,
    /// All its records up to this number are known.
    pub sequence: u64,
}

/// What the sender holds of authors.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct AuthorDigest {
    /// Authors that are not listed are unknown to the sender.
    pub whole: bool,
    /// One each.
    pub stamps: Vec<AuthorStamp>,
}

/// All records that the sender holds in one bucket with a key hash in `low..=high`.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct FleetBucket {
    /// Which bucket.
    pub bucket: u8,
    /// It answers another bucket and must not be answered by one.
    pub answer: bool,
    /// Least key hash covered.
    pub low: u32,
    /// Greatest key hash covered.
    pub high: u32,
    /// (key hash, version hash), by key hash.
    pub entries: Vec<(u32, u32)>,
}

/// Records of one author, by growing sequence.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct AuthorDelta {
    /// How far this brings a receiver that knows all up to `since`.
    pub stamp: AuthorStamp,
    /// Records up to this number are taken for granted.
    pub since: u64,
    /// (sequence, key, value); an empty value takes the record back.
    pub records: Vec<(u64, String, Vec<u8>)>,
}

const TAG_PING: u8 = 1;
const TAG_PONG: u8 = 2;
const TAG_AUTHOR_DIGEST: u8 = 3;
const TAG_AUTHOR_DELTA: u8 = 4;
const TAG_FLEET_DIGEST: u8 = 5;
const TAG_FLEET_BUCKET: u8 = 6;
const TAG_FLEET_RECORDS: u8 = 7;
const TAG_PEERS: u8 = 8;

impl Section {
    fn encode(&self) -> (u8, Vec<u8>) {
        let (tag, body) = match self {
            Self::Ping(number) => (TAG_PING, postcard::to_allocvec(number)),
            Self::Pong(number) => (TAG_PONG, postcard::to_allocvec(number)),
            Self::AuthorDigest(stamps) => (TAG_AUTHOR_DIGEST, postcard::to_allocvec(stamps)),
            Self::AuthorDelta(delta) => (TAG_AUTHOR_DELTA, postcard::to_allocvec(delta)),
            Self::FleetDigest(hashes) => (TAG_FLEET_DIGEST, postcard::to_allocvec(hashes)),
            Self::FleetBucket(bucket) => (TAG_FLEET_BUCKET, postcard::to_allocvec(bucket)),
            Self::FleetRecords(records) => (TAG_FLEET_RECORDS, postcard::to_allocvec(records)),
            Self::Peers(addresses) => (TAG_PEERS, postcard::to_allocvec(addresses)),
        };
        (tag, body.expect("writing plain data to memory cannot fail"))
    }

    /// The section behind `tag`; `None` for a tag of a later version.
    fn decode(tag: u8, body: &[u8]) -> Result<Option<Self>, WireError> {
        fn take<'a, T: Deserialize<'a>>(tag: u8, body: &'a [u8]) -> Result<T, WireError> {
            postcard::from_bytes(body).map_err(|_| WireError::Body(tag))
        }
        let section = match tag {
            TAG_PING => Self::Ping(take(tag, body)?),
            TAG_PONG => Self::Pong(take(tag, body)?),
            TAG_AUTHOR_DIGEST => Self::AuthorDigest(take(tag, body)?),
            TAG_AUTHOR_DELTA => Self::AuthorDelta(take(tag, body)?),
            TAG_FLEET_DIGEST => Self::FleetDigest(take(tag, body)?),
            TAG_FLEET_BUCKET => Self::FleetBucket(take(tag, body)?),
            TAG_FLEET_RECORDS => Self::FleetRecords(take(tag, body)?),
            TAG_PEERS => Self::Peers(take(tag, body)?),
            _ => return Ok(None),
        };
        Ok(Some(section))
    }

    /// Bytes this section takes in a datagram.
    pub(super) fn wire_len(&self) -> usize {
        3 + self.encode().1.len()
    }
}

impl Datagram {
    /// The bytes to send. Whoever builds it keeps below [`DATAGRAM_BYTES_MAX`].
    pub fn encode(&self) -> Vec<u8> {
        let mut bytes = Vec::with_capacity(256);
        bytes.extend_from_slice(&MAGIC);
        bytes.push(VERSION);
        bytes.extend_from_slice(&self.fleet.to_le_bytes());
        let name = self.from.as_str().as_bytes();
        bytes.push(u8::try_from(name.len()).expect("names have at most 32 bytes"));
        bytes.extend_from_slice(name);
        bytes.extend_from_slice(&self.incarnation.counter.to_le_bytes());
        bytes.extend_from_slice(&self.incarnation.nonce.to_le_bytes());
        for section in &self.sections {
            let (tag, body) = section.encode();
            bytes.push(tag);
            let length = u16::try_from(body.len()).expect("sections fit a datagram");
            bytes.extend_from_slice(&length.to_le_bytes());
            bytes.extend_from_slice(&body);
        }
        debug_assert!(bytes.len() <= DATAGRAM_BYTES_MAX, "{} bytes", bytes.len());
        bytes
    }

    /// Reads a datagram of `fleet`.
    pub fn decode(bytes: &[u8], fleet: u32) -> Result<Self, WireError> {
        if bytes.len() > DATAGRAM_BYTES_MAX {
            return Err(WireError::TooLong(bytes.len()));
        }
        let mut reader = Reader { bytes, at: 0 };
        if reader.take(2)? != MAGIC {
            return Err(WireError::Magic);
        }
        let version = reader.byte()?;
        if version != VERSION {
            return Err(WireError::Version(version));
        }
        if u32::from_le_bytes(reader.array()?) != fleet {
            return Err(WireError::Foreign);
        }
        let from = reader.name()?;
        let counter = u64::from_le_bytes(reader.array()?);
        let nonce = u32::from_le_bytes(reader.array()?);
        let mut sections = Vec::new();
        while reader.at < bytes.len() {
            let tag = reader.byte()?;
            let length = u16::from_le_bytes(reader.array()?);
            let body = reader.take(usize::from(length))?;
            sections.extend(Section::decode(tag, body)?);
        }
        Ok(Self { fleet, from, incarnation: Incarnation { counter, nonce }, sections })
    }

    /// Bytes of the header for a sender of this name.
    pub(super) fn header_len(from: &RobotId) -> usize {
        2 + 1 + 4 + 1 + from.as_str().len() + 8 + 4
    }
}

struct Reader<'a> {
    bytes: &'a [u8],
    at: usize,
}

impl<'a> Reader<'a> {
    fn take(&mut self, count: usize) -> Result<&'a [u8], WireError> {
        let end = self.at.saturating_add(count);
        let taken = self.bytes.get(self.at..end).ok_or(WireError::Short(self.bytes.len()))?;
        self.at = end;
        Ok(taken)
    }

    fn byte(&mut self) -> Result<u8, WireError> {
        Ok(self.take(1)?[0])
    }

    fn array<const N: usize>(&mut self) -> Result<[u8; N], WireError> {
        let taken = self.take(N)?;
        Ok(taken.try_into().expect("take gave N bytes"))
    }

    fn name(&mut self) -> Result<RobotId, WireError> {
        let length = usize::from(self.byte()?);
        if length > NAME_BYTES_MAX {
            return Err(WireError::Body(0));
        }
        let word = core::str::from_utf8(self.take(length)?).map_err(|_| WireError::Body(0))?;
        RobotId::new(word).map_err(|_| WireError::Body(0))
    }
}
