//! The datagram: header, then sections of (tag, length, body). Version 3.
//!
//! ```text
//! 0  "SD"            2  magic
//! 2  version         1  3
//! 3  fleet           4  FNV-1a of the fleet's name, folded, little endian
//! 7  sender          1 + n (n <= 32)
//!    incarnation     varint counter, 4 bytes nonce
//!    heartbeat       varint, milliseconds of the sender's clock since its start
//!    sequence        varint, greatest sequence of the sender's own records
//!    sections:       tag 1, varint length, body
//! ```
//!
//! Varints are LEB128. Unknown tags are skipped, so that version N-1 lives with N. Any bytes
//! at all are answered with a value or an error, never a panic.

mod beat;
mod record;
mod section;

use alloc::vec::Vec;

use thiserror::Error;

pub use beat::{Beat, PlacedBeat, Sign};
pub(super) use beat::{beat_len, cut, last_of};
pub(super) use record::{RecordRef, body_of};
pub(super) use section::TAG_FLEET_NEWS;
pub use section::{
    AskNews, AskStamps, AuthorDelta, Beats, Echo, FleetEntries, FleetNodes, LinkMark, News, Pulse,
    RosterPiece, SECTION_NAMES, Section, Stamp, Summary,
};

use super::Incarnation;
use crate::id::{NAME_BYTES_MAX, RobotId};

/// Most bytes that sealing adds to a datagram.
pub const SEAL_BYTES_MAX: usize = 32;
/// Longest datagram before it is sealed: 1200 bytes on the wire, so that no common link
/// fragments it.
pub const DATAGRAM_BYTES_MAX: usize = 1200 - SEAL_BYTES_MAX;
/// Longest header.
const HEADER_BYTES_MAX: usize = 2 + 1 + 4 + 1 + NAME_BYTES_MAX + 10 + 4 + 10 + 10;
/// Longest section with its tag and length that fits a datagram of any sender.
pub(super) const SECTION_BYTES_MAX: usize = DATAGRAM_BYTES_MAX - HEADER_BYTES_MAX - 20;
const MAGIC: [u8; 2] = *b"SD";
const VERSION: u8 = 3;

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

/// Who speaks, and how far it is.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Header {
    /// Which fleet.
    pub fleet: u32,
    /// Who sent it.
    pub from: RobotId,
    /// Under which incarnation.
    pub incarnation: Incarnation,
    /// Milliseconds of the sender's own clock since its start; never goes back.
    pub heartbeat: u64,
    /// The greatest sequence of the sender's own records.
    pub sequence: u64,
}

/// One datagram.
#[derive(Clone, Debug, PartialEq)]
pub struct Datagram {
    /// Who speaks.
    pub header: Header,
    /// What it says.
    pub sections: Vec<Section>,
}

impl Header {
    fn encode(&self) -> Vec<u8> {
        let mut bytes = Vec::with_capacity(256);
        bytes.extend_from_slice(&MAGIC);
        bytes.push(VERSION);
        bytes.extend_from_slice(&self.fleet.to_le_bytes());
        let name = self.from.as_str().as_bytes();
        bytes.push(u8::try_from(name.len()).expect("names have at most 32 bytes"));
        bytes.extend_from_slice(name);
        put_varint(self.incarnation.counter, &mut bytes);
        bytes.extend_from_slice(&self.incarnation.nonce.to_le_bytes());
        put_varint(self.heartbeat, &mut bytes);
        put_varint(self.sequence, &mut bytes);
        bytes
    }

    /// Adds the bytes of a datagram of this header to `counts`, by tag; the header's to 0.
    pub(super) fn tally(&self, datagram: &[u8], counts: &mut [u64; SECTION_NAMES.len()]) {
        let begin = self.encode().len().min(datagram.len());
        counts[0] += begin as u64;
        let mut reader = Reader { bytes: datagram, at: begin };
        while let Ok(tag) = reader.byte() {
            let Ok(length) = reader.varint() else { return };
            let before = reader.at;
            let taken = usize::try_from(length).ok().and_then(|length| reader.take(length).ok());
            let frame = 1 + varint_len(length);
            let count = counts.get_mut(usize::from(tag));
            count.into_iter().for_each(|count| *count += (reader.at - before + frame) as u64);
            if taken.is_none() {
                return;
            }
        }
    }

    /// Packs `sections`, in order, into as few datagrams as hold them; one that fits no
    /// datagram is left out.
    pub fn pack(&self, sections: &[Section]) -> Vec<Vec<u8>> {
        let encoded: Vec<(u8, Vec<u8>)> = sections.iter().map(Section::encode).collect();
        self.pack_encoded(encoded.iter())
    }

    /// The same of sections by their tags and bodies.
    pub(super) fn pack_encoded<'a>(
        &self,
        sections: impl Iterator<Item = &'a (u8, Vec<u8>)>,
    ) -> Vec<Vec<u8>> {
        let mut bytes = self.encode();
        let header_len = bytes.len();
        let mut packed = Vec::new();
        for (tag, body) in sections {
            let size = body.len() + 3;
            if header_len + size > DATAGRAM_BYTES_MAX {
                continue;
            }
            if bytes.len() + size > DATAGRAM_BYTES_MAX {
                let next = bytes[..header_len].to_vec();
                packed.push(core::mem::replace(&mut bytes, next));
            }
            bytes.push(*tag);
            put_varint(body.len() as u64, &mut bytes);
            bytes.extend_from_slice(body);
        }
        packed.push(bytes);
        packed
    }
}

impl Datagram {
    /// Reads a datagram of `fleet`.
    pub fn decode(bytes: &[u8], fleet: u32) -> Result<Self, WireError> {
        Self::decode_news(bytes, fleet, &|_| false)
    }

    /// Reads a datagram of `fleet`, but for the records of facts that are `known`.
    pub(super) fn decode_news(
        bytes: &[u8],
        fleet: u32,
        known: &dyn Fn(&RecordRef<'_>) -> bool,
    ) -> Result<Self, WireError> {
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
        let counter = reader.varint()?;
        let nonce = u32::from_le_bytes(reader.array()?);
        let incarnation = Incarnation { counter, nonce };
        let (heartbeat, sequence) = (reader.varint()?, reader.varint()?);
        let mut sections = Vec::new();
        while reader.at < bytes.len() {
            let tag = reader.byte()?;
            let length = usize::try_from(reader.varint()?).unwrap_or(usize::MAX);
            let body = reader.take(length)?;
            sections.extend(Section::decode(tag, body, known)?);
        }
        Ok(Self { header: Header { fleet, from, incarnation, heartbeat, sequence }, sections })
    }
}

/// Whether bytes begin as a plain datagram of some version does.
pub fn is_plain(bytes: &[u8]) -> bool {
    bytes.strip_prefix(&MAGIC).and_then(<[u8]>::first).is_some_and(|version| *version <= 16)
}

/// Writes 7 bits a byte, lowest first.
fn put_varint(value: u64, bytes: &mut Vec<u8>) {
    let mut rest = value;
    while rest >= 0x80 {
        bytes.push(u8::try_from(rest & 0x7f).unwrap_or(0) | 0x80);
        rest >>= 7;
    }
    bytes.push(u8::try_from(rest).unwrap_or(0));
}

/// Bytes of a varint.
pub(super) fn varint_len(value: u64) -> usize {
    let bits = u64::BITS - (value | 1).leading_zeros();
    usize::try_from(bits.div_ceil(7)).unwrap_or(10)
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

    fn varint(&mut self) -> Result<u64, WireError> {
        let mut value = 0;
        for shift in (0..64).step_by(7) {
            let byte = self.byte()?;
            let bits = u64::from(byte & 0x7f);
            if shift == 63 && bits > 1 {
                return Err(WireError::Body(0));
            }
            value |= bits << shift;
            if byte < 0x80 {
                return Ok(value);
            }
        }
        Err(WireError::Body(0))
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
