//! One robot's sign of life in three to six bytes.
//!
//! ```text
//! who        its place among all names, when both ends know the same robots: one byte in
//!            nearly all cases, none in a run of neighbours; else 2 or 3 bytes, the upper
//!            ones of its id, most significant first
//! 3 bytes    life 1 bit, heartbeat 10 bits, sequence 6 bits, age 7 bits, most significant
//!            first
//! ```

use alloc::vec::Vec;
use core::time::Duration;

use super::{Reader, WireError, put_varint};

/// Most beats in one section.
pub(crate) const BEATS_MAX: usize = 250;
/// Milliseconds of the author's clock in one step of a beat's heartbeat, as a shift.
pub(crate) const HEARTBEAT_SHIFT: u32 = 8;
const HEARTBEAT_MASK: u64 = 0x3ff;
const SEQUENCE_MASK: u64 = 0x3f;
/// A sequence further ahead than this is one behind: few senders are far behind, while a
/// receiver that was away lacks many.
const SEQUENCE_AHEAD_MAX: u64 = 47;

/// Older news is no sign: its heartbeat might be taken for a newer one, since half a turn of
/// its bits is 131 s.
const AGE_MAX_MS: u32 = 128_000;

/// Ages that a beat can say, milliseconds: steps of 32 ms to 2 s, then of 7.5 % to 210 s.
const AGES_MS: [u32; 128] = ages();

const fn ages() -> [u32; 128] {
    let mut table = [0; 128];
    let mut index = 1;
    while index < 128 {
        let before: u32 = table[index - 1];
        table[index] = if index < 64 { before + 32 } else { before + (before * 75).div_ceil(1000) };
        index += 1;
    }
    table
}

/// News of one robot, cut to the bits that one needs who knows the robot.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Sign {
    /// Whether the counter of the robot's incarnation is odd: lives that follow each other
    /// differ in it.
    pub odd: bool,
    /// Lowest 10 bits of the heartbeat's 256 ms steps.
    pub heartbeat: u16,
    /// Lowest 6 bits of the author's sequence, as far as the sender holds it.
    pub sequence: u8,
    /// How long ago the robot said that heartbeat, coded.
    pub age: u8,
}

/// News of one robot by its id.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Beat {
    /// Upper bits of the robot's id; the lower ones are zero.
    pub id: u32,
    /// What is known of it.
    pub sign: Sign,
}

/// News of one robot by its place among all robots that sender and receiver know.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct PlacedBeat {
    /// How many names are smaller.
    pub place: u16,
    /// What is known of it.
    pub sign: Sign,
}

impl Sign {
    /// A robot whose heartbeat (ms) in its life number `life` was said `age` ago; `None`
    /// when that is too long ago for a beat.
    pub fn new(life: u64, heartbeat: u64, sequence: u64, age: Duration) -> Option<Self> {
        let age_ms = u32::try_from(age.as_millis()).unwrap_or(u32::MAX);
        let code = AGES_MS.partition_point(|step| *step < age_ms);
        let cut = (heartbeat >> HEARTBEAT_SHIFT) & HEARTBEAT_MASK;
        (age_ms <= AGE_MAX_MS && code < AGES_MS.len()).then_some(Self {
            odd: life & 1 == 1,
            heartbeat: u16::try_from(cut).unwrap_or(0),
            sequence: u8::try_from(sequence & SEQUENCE_MASK).unwrap_or(0),
            age: u8::try_from(code).unwrap_or(0),
        })
    }

    /// How long ago the heartbeat was said, rounded up.
    pub fn age(&self) -> Duration {
        let index = usize::from(self.age).min(AGES_MS.len() - 1);
        Duration::from_millis(u64::from(AGES_MS[index]))
    }

    /// The whole heartbeat, when it is greater than `known`, whose news is not older than
    /// 128 s.
    pub fn heartbeat_after(&self, known: u64) -> Option<u64> {
        let steps = known >> HEARTBEAT_SHIFT;
        let ahead = u64::from(self.heartbeat).wrapping_sub(steps) & HEARTBEAT_MASK;
        let newer = ahead != 0 && ahead <= HEARTBEAT_MASK / 2;
        newer.then(|| steps.saturating_add(ahead) << HEARTBEAT_SHIFT)
    }

    /// Whether the sender holds records of the author that one at `known` lacks.
    pub fn is_ahead_of(&self, known: u64) -> bool {
        let ahead = u64::from(self.sequence).wrapping_sub(known) & SEQUENCE_MASK;
        ahead != 0 && ahead <= SEQUENCE_AHEAD_MAX
    }

    fn encode(self, bytes: &mut Vec<u8>) {
        let packed = u32::from(self.odd) << 23
            | u32::from(self.heartbeat & 0x3ff) << 13
            | u32::from(self.sequence & 0x3f) << 7
            | u32::from(self.age & 0x7f);
        bytes.extend_from_slice(&packed.to_be_bytes()[1..]);
    }

    fn decode(reader: &mut Reader<'_>) -> Result<Self, WireError> {
        let [first, second, third]: [u8; 3] = reader.array()?;
        let packed = u32::from_be_bytes([0, first, second, third]);
        let bits = |shift: u32, mask: u32| (packed >> shift) & mask;
        Ok(Self {
            odd: bits(23, 1) == 1,
            heartbeat: u16::try_from(bits(13, 0x3ff)).unwrap_or(0),
            sequence: u8::try_from(bits(7, 0x3f)).unwrap_or(0),
            age: u8::try_from(bits(0, 0x7f)).unwrap_or(0),
        })
    }
}

impl Beat {
    pub(super) fn encode(&self, wide: bool, bytes: &mut Vec<u8>) {
        bytes.extend_from_slice(&self.id.to_be_bytes()[..id_len(wide)]);
        self.sign.encode(bytes);
    }

    pub(super) fn decode(wide: bool, reader: &mut Reader<'_>) -> Result<Self, WireError> {
        let mut id = [0; 4];
        id[..id_len(wide)].copy_from_slice(reader.take(id_len(wide))?);
        Ok(Self { id: u32::from_be_bytes(id), sign: Sign::decode(reader)? })
    }
}

/// Runs shorter than this are written beat by beat.
const RUN_MIN: usize = 3;

/// Writes beats by growing place. Each begins with how many places it is further than the one
/// after the last, times two; odd for a run, whose length follows.
pub(super) fn encode_placed(beats: &[PlacedBeat], bytes: &mut Vec<u8>) {
    let (mut rest, mut next) = (beats, 0u16);
    while let Some(first) = rest.first() {
        let place = |index: usize| u16::try_from(index).ok()?.checked_add(first.place);
        let ahead = rest.iter().enumerate();
        let run = ahead.take_while(|(index, beat)| place(*index) == Some(beat.place)).count();
        let run = if run < RUN_MIN { 1 } else { run };
        let skipped = u64::from(first.place.wrapping_sub(next)) << 1;
        put_varint(skipped | u64::from(run > 1), bytes);
        if run > 1 {
            put_varint(run as u64, bytes);
        }
        let (written, after) = rest.split_at(run);
        written.iter().for_each(|beat| beat.sign.encode(bytes));
        next = written.last().map_or(0, |last| last.place.wrapping_add(1));
        rest = after;
    }
}

/// Reads them until the body ends.
pub(super) fn decode_placed(
    tag: u8,
    reader: &mut Reader<'_>,
) -> Result<Vec<PlacedBeat>, WireError> {
    let mut beats = Vec::new();
    let mut next = 0u64;
    while reader.at < reader.bytes.len() && beats.len() < BEATS_MAX {
        let word = reader.varint()?;
        let run = if word & 1 == 1 { reader.varint()? } else { 1 };
        next = next.saturating_add(word >> 1);
        for _ in 0..run.min(BEATS_MAX as u64) {
            let place = u16::try_from(next).map_err(|_| WireError::Body(tag))?;
            beats.push(PlacedBeat { place, sign: Sign::decode(reader)? });
            next += 1;
        }
    }
    Ok(beats)
}

/// The bits of an id that stand on the wire.
pub(crate) fn cut(id: u32, wide: bool) -> u32 {
    if wide { id & 0xffff_ff00 } else { id & 0xffff_0000 }
}

/// The greatest id with the same bits on the wire.
pub(crate) fn last_of(cut: u32, wide: bool) -> u32 {
    if wide { cut | 0xff } else { cut | 0xffff }
}

/// Bytes of a beat.
pub(crate) const fn beat_len(wide: bool) -> usize {
    id_len(wide) + 3
}

const fn id_len(wide: bool) -> usize {
    if wide { 3 } else { 2 }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn ages_are_rounded_up_by_little() {
        for ms in [0u64, 1, 31, 32, 500, 1999, 2016, 2017, 9_999, 60_000, 127_000] {
            let beat = Sign::new(0, 0, 0, Duration::from_millis(ms)).unwrap();
            let told = u64::try_from(beat.age().as_millis()).unwrap();
            assert!(told >= ms && told <= ms + 32 + ms * 8 / 100, "{ms} told as {told}");
        }
        assert!(Sign::new(0, 0, 0, Duration::from_secs(129)).is_none());
    }

    #[test]
    fn a_heartbeat_is_known_again_by_its_lowest_bits() {
        let beat = |heartbeat| Sign::new(1, heartbeat, 0, Duration::ZERO).unwrap();
        let known = 1_000_000;
        assert_eq!(beat(known).heartbeat_after(known), None);
        assert_eq!(beat(known - 5_000).heartbeat_after(known), None);
        for ahead in [300u64, 5_000, 120_000] {
            let whole = beat(known + ahead).heartbeat_after(known).unwrap();
            assert_eq!(whole, (known + ahead) >> HEARTBEAT_SHIFT << HEARTBEAT_SHIFT);
        }
    }

    #[test]
    fn a_sequence_is_compared_by_its_lowest_bits() {
        let beat = |sequence| Sign::new(1, 0, sequence, Duration::ZERO).unwrap();
        assert!(beat(130).is_ahead_of(127));
        assert!(!beat(127).is_ahead_of(127));
        assert!(!beat(120).is_ahead_of(127));
        assert!(beat(40).is_ahead_of(0));
    }
}
