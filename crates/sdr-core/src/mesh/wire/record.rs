//! Records of the fleet table in a datagram: most are known, and are passed over unread.

use alloc::vec::Vec;

use serde::{Deserialize, Serialize};

use super::{Reader, WireError};
use crate::{
    mesh::{Fact, FleetRecord},
    record::RecordKind,
};

/// A record as it lies in a datagram.
#[derive(Debug, Deserialize)]
pub(in crate::mesh) struct RecordRef<'a> {
    #[serde(borrow)]
    key: KeyRef<'a>,
    version: VersionRef<'a>,
    value: &'a [u8],
}

#[derive(Debug, Deserialize)]
struct KeyRef<'a> {
    kind: RecordKind,
    name: &'a str,
}

#[derive(Debug, Deserialize)]
struct VersionRef<'a> {
    #[serde(borrow)]
    epoch: Option<EpochRef<'a>>,
    revision: u64,
    term: u64,
    author: &'a str,
}

#[derive(Debug, Deserialize)]
struct EpochRef<'a> {
    number: u64,
    minted_by: &'a str,
}

impl RecordRef<'_> {
    pub(in crate::mesh) fn kind(&self) -> RecordKind {
        self.key.kind
    }

    pub(in crate::mesh) fn name(&self) -> &str {
        self.key.name
    }

    /// Whether a fact of this key says the same.
    pub(in crate::mesh) fn is(&self, fact: &Fact) -> bool {
        let known = fact.version();
        let epoch = match (&self.version.epoch, &known.epoch) {
            (Some(own), Some(known)) => {
                own.number == known.number && own.minted_by == known.minted_by.as_str()
            }
            (None, None) => true,
            (Some(_), None) | (None, Some(_)) => false,
        };
        epoch
            && self.version.revision == known.revision
            && self.version.term == known.term
            && self.version.author == known.author.as_str()
            && self.value == fact.record().value.as_slice()
    }
}

/// The records of a section, without those that are known.
pub(super) fn unknown_of(
    tag: u8,
    body: &[u8],
    known: &dyn Fn(&RecordRef<'_>) -> bool,
) -> Result<Vec<FleetRecord>, WireError> {
    let wrong = |_| WireError::Body(tag);
    let mut reader = Reader { bytes: body, at: 0 };
    let count = reader.varint()?;
    let mut rest = &body[reader.at..];
    let mut records = Vec::new();
    for _ in 0..count {
        let (record, after) = postcard::take_from_bytes::<RecordRef<'_>>(rest).map_err(wrong)?;
        if !known(&record) {
            records.push(postcard::take_from_bytes::<FleetRecord>(rest).map_err(wrong)?.0);
        }
        rest = after;
    }
    Ok(records)
}

/// The bytes of a section of records.
pub(in crate::mesh) fn body_of(records: &[&FleetRecord]) -> Vec<u8> {
    fn plain<T: Serialize + ?Sized>(value: &T) -> Vec<u8> {
        postcard::to_allocvec(value).expect("writing plain data to memory cannot fail")
    }
    plain(records)
}
