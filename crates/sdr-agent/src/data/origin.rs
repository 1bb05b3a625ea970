//! Who made a sample, and how that travels beside a pure CDR payload.
//!
//! DDS offers two fields of the caller's choice with each sample: a *related sample identity*
//! (16 bytes of GUID, 8 of sequence number) and a source timestamp (8 bytes). Foreign readers
//! skip the first and see the second as the sample's time.
//!
//! ```text
//! GUID   0..6   number of the epoch, little endian;     sequence number, as one i64:
//!               top 2 of its bits: body length modulo 4  bits  0..40  sequence
//!        6..10  run, little endian                       bits 40..63  tick, low 23 bits
//!        10..14 hash of the minting robot's name
//!        14..16 tick, high 16 bits
//! timestamp     the producer's CLOCK_MONOTONIC as seconds and 2^-32 fractions
//! ```
//!
//! Where a body is too large for one datagram the same 32 bytes and a mark stand at its end
//! instead.
//!
//! The body's length is there because RTPS pads bodies to a multiple of 4 bytes.
//! CLOCK_MONOTONIC is one clock for all robots of one machine; between machines the source
//! time says nothing and must not be compared.

use sdr_core::{id::RobotId, order::hash64};

/// Length of an origin at the end of a body.
pub(crate) const TRAILER_BYTES: usize = 40;
/// The last bytes of a trailer: nothing that a message would end with by chance.
const MARK: [u8; 8] = *b"\x9dsdr\xf1or\x01";

const EPOCH_BITS: u32 = 46;
const EPOCH_MAX: u64 = (1 << EPOCH_BITS) - 1;
const SEQUENCE_MAX: u64 = (1 << 40) - 1;
const TICK_MAX: u64 = (1 << 39) - 1;
const TICK_LOW_BITS: u32 = 23;
const NANOS: u64 = 1_000_000_000;

/// A robot's name in 32 bits.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(crate) struct RobotHash(u32);

impl RobotHash {
    pub(crate) fn of(robot: &RobotId) -> Self {
        let hash = hash64(robot.as_str().as_bytes());
        let folded = (hash >> 32) ^ (hash & 0xffff_ffff);
        Self(u32::try_from(folded).expect("the upper half is masked off"))
    }
}

/// What the consumer's fence and statistics need to know of a sample.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Origin {
    pub(crate) epoch: u64,
    pub(crate) minter: RobotHash,
    pub(crate) run: u32,
    pub(crate) sequence: u64,
    pub(crate) tick: u64,
    pub(crate) source_time_ns: u64,
}

/// An origin as DDS carries it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Identity {
    pub(crate) guid: [u8; 16],
    pub(crate) sequence: i64,
    pub(crate) timestamp: u64,
}

impl Origin {
    /// The origin in DDS terms, for a body of so many bytes; `None` when a number is too great
    /// for its field.
    pub(crate) fn to_identity(self, body_bytes: usize) -> Option<Identity> {
        let fits = self.epoch <= EPOCH_MAX
            && self.sequence <= SEQUENCE_MAX
            && self.tick <= TICK_MAX
            && self.source_time_ns / NANOS < u64::from(u32::MAX);
        if !fits {
            return None;
        }
        let mut guid = [0; 16];
        let epoch = self.epoch | ((body_bytes as u64 & 3) << EPOCH_BITS);
        guid[0..6].copy_from_slice(&epoch.to_le_bytes()[0..6]);
        guid[6..10].copy_from_slice(&self.run.to_le_bytes());
        guid[10..14].copy_from_slice(&self.minter.0.to_le_bytes());
        guid[14..16].copy_from_slice(&(self.tick >> TICK_LOW_BITS).to_le_bytes()[0..2]);
        let tick_low = self.tick & ((1 << TICK_LOW_BITS) - 1);
        let sequence = i64::try_from(self.sequence | (tick_low << 40)).ok()?;
        Some(Identity { guid, sequence, timestamp: fixed_from_nanos(self.source_time_ns) })
    }

    /// The origin that [`Origin::to_identity`] wrote.
    pub(crate) fn from_identity(identity: &Identity) -> Self {
        let guid = &identity.guid;
        let word = |from: usize| u32::from_le_bytes(std::array::from_fn(|at| guid[from + at]));
        let mut epoch = [0; 8];
        epoch[0..6].copy_from_slice(&guid[0..6]);
        let numbers = identity.sequence.cast_unsigned();
        let tick_high = u64::from(u16::from_le_bytes([guid[14], guid[15]]));
        let tick_low = (numbers >> 40) & ((1 << TICK_LOW_BITS) - 1);
        Self {
            epoch: u64::from_le_bytes(epoch) & EPOCH_MAX,
            run: word(6),
            minter: RobotHash(word(10)),
            sequence: numbers & SEQUENCE_MAX,
            tick: (tick_high << TICK_LOW_BITS) | tick_low,
            source_time_ns: nanos_from_fixed(identity.timestamp),
        }
    }
}

impl Identity {
    /// The same as bytes to be appended to a body.
    pub(crate) fn to_trailer(self) -> [u8; TRAILER_BYTES] {
        let mut trailer = [0; TRAILER_BYTES];
        trailer[0..16].copy_from_slice(&self.guid);
        trailer[16..24].copy_from_slice(&self.sequence.to_le_bytes());
        trailer[24..32].copy_from_slice(&self.timestamp.to_le_bytes());
        trailer[32..40].copy_from_slice(&MARK);
        trailer
    }

    /// The identity at the end of a body, when there is one.
    pub(crate) fn from_trailer(body: &[u8]) -> Option<Self> {
        let trailer: &[u8; TRAILER_BYTES] = body.last_chunk()?;
        let word = |from: usize| std::array::from_fn(|at| trailer[from + at]);
        (trailer[32..40] == MARK).then(|| Self {
            guid: std::array::from_fn(|at| trailer[at]),
            sequence: i64::from_le_bytes(word(16)),
            timestamp: u64::from_le_bytes(word(24)),
        })
    }

    /// How many bytes of a body that arrived as `arrived_bytes` were really sent.
    pub(crate) fn body_bytes(&self, arrived_bytes: usize) -> usize {
        let sent = usize::from(self.guid[5] >> 6);
        arrived_bytes - (arrived_bytes.wrapping_sub(sent) & 3).min(arrived_bytes)
    }
}

/// Seconds and 2^-32 fractions, rounded to the nearest: fine enough to give every nanosecond back.
fn fixed_from_nanos(nanos: u64) -> u64 {
    let fraction = (((nanos % NANOS) << 32) + NANOS / 2) / NANOS;
    ((nanos / NANOS) << 32) + fraction
}

fn nanos_from_fixed(fixed: u64) -> u64 {
    let fraction = fixed & 0xffff_ffff;
    (fixed >> 32) * NANOS + ((fraction * NANOS + (1 << 31)) >> 32)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn robot(word: &str) -> RobotId {
        RobotId::new(word).unwrap()
    }

    fn origin() -> Origin {
        Origin {
            epoch: 7,
            minter: RobotHash::of(&robot("robot-1")),
            run: 3,
            sequence: 41,
            tick: 42,
            source_time_ns: 1_234_567_890_123,
        }
    }

    #[test]
    fn an_origin_comes_back_as_it_was_to_the_last_bit() {
        let extremes = [0, 1, 999_999_999, NANOS, u64::from(u32::MAX - 1) * NANOS + 999_999_999];
        for source_time_ns in extremes {
            for (epoch, run, sequence, tick) in
                [(0, 0, 0, 0), (EPOCH_MAX, u32::MAX, SEQUENCE_MAX, TICK_MAX), (5, 1, 2, 1 << 24)]
            {
                let sent = Origin { epoch, run, sequence, tick, source_time_ns, ..origin() };
                let identity = sent.to_identity(3).unwrap();
                assert!(identity.sequence >= 0);
                assert_eq!(Origin::from_identity(&identity), sent);
            }
        }
    }

    #[test]
    fn a_trailer_is_found_only_where_one_is() {
        let identity = origin().to_identity(0).unwrap();
        let mut body = vec![7; 100];
        assert_eq!(Identity::from_trailer(&body), None);
        assert_eq!(Identity::from_trailer(&body[..3]), None);
        body.extend_from_slice(&identity.to_trailer());
        assert_eq!(Identity::from_trailer(&body), Some(identity));
    }

    #[test]
    fn padding_is_told_from_the_body() {
        for sent in 0..20_usize {
            let identity = origin().to_identity(sent).unwrap();
            assert_eq!(identity.body_bytes(sent.next_multiple_of(4)), sent);
            assert_eq!(identity.body_bytes(sent), sent);
        }
    }

    #[test]
    fn every_nanosecond_of_a_second_survives_the_fraction() {
        for nanos in (0..NANOS).step_by(9_973) {
            assert_eq!(nanos_from_fixed(fixed_from_nanos(nanos)), nanos);
        }
    }

    #[test]
    fn a_number_too_great_for_its_field_is_refused_rather_than_cut() {
        assert_eq!(Origin { epoch: EPOCH_MAX + 1, ..origin() }.to_identity(0), None);
        assert_eq!(Origin { sequence: SEQUENCE_MAX + 1, ..origin() }.to_identity(0), None);
        assert_eq!(Origin { tick: TICK_MAX + 1, ..origin() }.to_identity(0), None);
        assert_eq!(Origin { source_time_ns: u64::MAX, ..origin() }.to_identity(0), None);
    }

    #[test]
    fn robots_of_a_fleet_have_different_hashes() {
        let hashes: std::collections::BTreeSet<_> =
            (0..1000).map(|n| RobotHash::of(&robot(&format!("robot-{n}")))).collect();
        assert_eq!(hashes.len(), 1000);
    }
}
