//! Quantities as people write them, each with its unit: `530MB`, `15Hz`, `-52.5dBm`, `80%`.
//!
//! A number finer than its type is refused rather than rounded.

use std::time::Duration;

use sdr_core::units::{Bytes, Dbm, Permille};
use thiserror::Error;

use crate::near::nearest;

/// Why a word is no quantity. The author of the file can mend it.
#[derive(Clone, Debug, PartialEq, Eq, Error)]
#[non_exhaustive]
pub enum UnitError {
    /// Nothing that begins with a number.
    #[error("`{found}` does not begin with a number")]
    NoNumber {
        /// The word as given.
        found: String,
    },
    /// A bare number.
    #[error("`{found}` has no unit")]
    NoUnit {
        /// The word as given.
        found: String,
    },
    /// A unit of something else, or none that is known.
    #[error("`{found}` has the unknown unit `{unit}`{}", meant.map(|unit| format!(" (did you mean `{unit}`?)")).unwrap_or_default())]
    UnknownUnit {
        /// The word as given.
        found: String,
        /// Its unit.
        unit: String,
        /// The nearest unit that is allowed.
        meant: Option<&'static str>,
    },
    /// More digits than the type holds.
    #[error("`{found}` is finer than {step}")]
    TooFine {
        /// The word as given.
        found: String,
        /// The smallest step.
        step: &'static str,
    },
    /// Outside what the type holds.
    #[error("`{found}` is out of range")]
    OutOfRange {
        /// The word as given.
        found: String,
    },
}

/// One family of units: words with their size in the family's smallest step.
struct Family {
    units: &'static [(&'static str, u64)],
    step: &'static str,
}

const SIZES: Family = Family {
    units: &[
        ("B", 1),
        ("kB", 1_000),
        ("MB", 1_000_000),
        ("GB", 1_000_000_000),
        ("TB", 1_000_000_000_000),
        ("KiB", 1 << 10),
        ("MiB", 1 << 20),
        ("GiB", 1 << 30),
    ],
    step: "one byte",
};
const TIMES: Family = Family {
    units: &[
        ("ns", 1),
        ("us", 1_000),
        ("ms", 1_000_000),
        ("s", 1_000_000_000),
        ("min", 60_000_000_000),
        ("h", 3_600_000_000_000),
    ],
    step: "one nanosecond",
};
const SHARES: Family = Family { units: &[("%", 10)], step: "a tenth of a per cent" };
const LEVELS: Family = Family { units: &[("dBm", 10)], step: "a tenth of a dBm" };
const DISTANCES: Family =
    Family { units: &[("mm", 1), ("cm", 10), ("m", 1_000), ("km", 1_000_000)], step: "one mm" };
const RATES: Family =
    Family { units: &[("mHz", 1), ("Hz", 1_000), ("kHz", 1_000_000)], step: "one mHz" };

const BIT_RATES: Family =
    Family { units: &[("bit/s", 1), ("kbit/s", 1_000), ("Mbit/s", 1_000_000)], step: "one bit/s" };

/// What [`size`] takes, for errors.
pub const SIZE_HELP: &str =
    "a size such as 200MB (MB = 10^6, MiB = 2^20; B, kB, MB, GB, TB, KiB, MiB, GiB)";
/// What [`duration`] takes, for errors.
pub const DURATION_HELP: &str = "a time such as 200ms (ns, us, ms, s, min, h)";
/// What [`share`] takes, for errors.
pub const SHARE_HELP: &str = "a share such as 80% (to a tenth; of CPU, 100% is one core)";
/// What [`level`] takes, for errors.
pub const LEVEL_HELP: &str = "a radio level such as -52.5dBm (-150dBm to 30dBm, to a tenth)";
/// What [`distance_mm`] takes, for errors.
pub const DISTANCE_HELP: &str = "a distance such as 30m (mm, cm, m, km)";
/// What [`period`] takes, for errors.
pub const RATE_HELP: &str = "a rate such as 15Hz (mHz, Hz, kHz; 1mHz to 10kHz)";

/// What [`offset_mm`] takes, for errors.
pub const OFFSET_HELP: &str = "a place such as -3.5m (mm, cm, m, km; -100km to 100km)";
/// What [`bit_rate`] takes, for errors.
pub const BIT_RATE_HELP: &str =
    "a rate such as 20Mbit/s (bit/s, kbit/s, Mbit/s; 1kbit/s to 10000Mbit/s)";

/// An amount of memory: `530MB`, `1.9GB`, `64MiB`.
pub fn size(text: &str) -> Result<Bytes, UnitError> {
    let bytes = SIZES.parse(text)?;
    u64::try_from(bytes).map(Bytes).map_err(|_| out_of_range(text))
}

/// A time: `200ms`, `1.5s`, `2min`.
pub fn duration(text: &str) -> Result<Duration, UnitError> {
    let nanoseconds = TIMES.parse(text)?;
    u64::try_from(nanoseconds).map(Duration::from_nanos).map_err(|_| out_of_range(text))
}

/// A share: `80%`, `12.5%`; of CPU `400%` is four cores.
pub fn share(text: &str) -> Result<Permille, UnitError> {
    let thousandths = SHARES.parse(text)?;
    u32::try_from(thousandths).map(Permille).map_err(|_| out_of_range(text))
}

/// A radio level: `-52.5dBm`.
pub fn level(text: &str) -> Result<Dbm, UnitError> {
    let tenths = LEVELS.parse(text)?;
    match i16::try_from(tenths) {
        Ok(tenths) if (-1500..=300).contains(&tenths) => Ok(Dbm::from_tenths(tenths)),
        Ok(_) | Err(_) => Err(out_of_range(text)),
    }
}

/// A distance in millimetres: `30m`, `1.5km`.
pub fn distance_mm(text: &str) -> Result<u64, UnitError> {
    u64::try_from(DISTANCES.parse(text)?).map_err(|_| out_of_range(text))
}

/// A place along a line, in millimetres: `-3.5m`.
pub fn offset_mm(text: &str) -> Result<i32, UnitError> {
    let offset = i32::try_from(DISTANCES.parse(text)?).map_err(|_| out_of_range(text))?;
    match offset.unsigned_abs() <= 100_000_000 {
        true => Ok(offset),
        false => Err(out_of_range(text)),
    }
}

/// Bits a second: `20Mbit/s`.
pub fn bit_rate(text: &str) -> Result<u64, UnitError> {
    match u64::try_from(BIT_RATES.parse(text)?) {
        Ok(rate) if (1_000..=10_000_000_000).contains(&rate) => Ok(rate),
        Ok(_) | Err(_) => Err(out_of_range(text)),
    }
}

/// The period of a rate, to a nanosecond: `50Hz` is 20 ms.
pub fn period(text: &str) -> Result<Duration, UnitError> {
    let millihertz = u64::try_from(RATES.parse(text)?).map_err(|_| out_of_range(text))?;
    if !(1..=10_000_000).contains(&millihertz) {
        return Err(out_of_range(text));
    }
    Ok(Duration::from_nanos(1_000_000_000_000 / millihertz))
}

fn out_of_range(text: &str) -> UnitError {
    UnitError::OutOfRange { found: text.to_owned() }
}

impl Family {
    /// The number in smallest steps.
    fn parse(&self, text: &str) -> Result<i128, UnitError> {
        let found = || text.to_owned();
        let word = text.trim();
        let (negative, rest) = match word.strip_prefix('-') {
            Some(rest) => (true, rest),
            None => (false, word),
        };
        let end = rest
            .find(|character: char| !character.is_ascii_digit() && character != '.')
            .unwrap_or(rest.len());
        let (number, unit) = (&rest[..end], rest[end..].trim());
        let (whole, fraction) = number.split_once('.').unwrap_or((number, ""));
        if whole.is_empty() || fraction.contains('.') || number.ends_with('.') {
            return Err(UnitError::NoNumber { found: found() });
        }
        let factor = self.factor(unit).map_err(|meant| match unit {
            "" => UnitError::NoUnit { found: found() },
            _ => UnitError::UnknownUnit { found: found(), unit: unit.to_owned(), meant },
        })?;
        let fraction = fraction.trim_end_matches('0');
        if whole.len() + fraction.len() > 20 {
            return Err(UnitError::OutOfRange { found: found() });
        }
        let digits: i128 = format!("{whole}{fraction}").parse().map_err(|_| out_of_range(text))?;
        let divisor = (0..fraction.len()).fold(1_i128, |product, _| product * 10);
        let scaled = digits * i128::from(factor);
        if scaled % divisor != 0 {
            return Err(UnitError::TooFine { found: found(), step: self.step });
        }
        Ok(if negative { -(scaled / divisor) } else { scaled / divisor })
    }

    /// The same word in another case, else the first unit that goes on from it (`M`: `MB`), else
    /// the nearest.
    fn meant(&self, unit: &str) -> Option<&'static str> {
        let words = || self.units.iter().map(|(word, _)| *word);
        let begun = |word: &&str| word.to_lowercase().starts_with(&unit.to_lowercase());
        let same = words().find(|word| word.eq_ignore_ascii_case(unit));
        same.or_else(|| words().find(begun)).or_else(|| nearest(unit, words()))
    }

    /// The unit's size, or the unit that was probably meant.
    fn factor(&self, unit: &str) -> Result<u64, Option<&'static str>> {
        match self.units.iter().find(|(word, _)| *word == unit) {
            Some((_, factor)) => Ok(*factor),
            None => Err(self.meant(unit)),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn quantities_are_exact() {
        assert_eq!(size("1.9GB"), Ok(Bytes(1_900_000_000)));
        assert_eq!(size("64 MiB"), Ok(Bytes(64 << 20)));
        assert_eq!(duration("2min"), Ok(Duration::from_secs(120)));
        assert_eq!(duration("1.5ms"), Ok(Duration::from_micros(1500)));
        assert_eq!(share("400%"), Ok(Permille(4000)));
        assert_eq!(share("12.5%"), Ok(Permille(125)));
        assert_eq!(level("-52.5dBm"), Ok(Dbm::from_tenths(-525)));
        assert_eq!(distance_mm("30m"), Ok(30_000));
        assert_eq!(offset_mm("-3.5m"), Ok(-3_500));
        assert_eq!(bit_rate("20Mbit/s"), Ok(20_000_000));
        assert_eq!(period("15Hz"), Ok(Duration::from_nanos(66_666_666)));
        assert_eq!(period("0.5Hz"), Ok(Duration::from_secs(2)));
    }

    #[test]
    fn a_wrong_quantity_says_why() {
        assert!(matches!(size("530"), Err(UnitError::NoUnit { .. })));
        assert!(matches!(size("x"), Err(UnitError::NoNumber { .. })));
        assert!(matches!(size("1..2MB"), Err(UnitError::NoNumber { .. })));
        assert!(matches!(size("1.MB"), Err(UnitError::NoNumber { .. })));
        assert!(matches!(size("-1MB"), Err(UnitError::OutOfRange { .. })));
        assert!(matches!(size("0.5B"), Err(UnitError::TooFine { .. })));
        assert!(matches!(size("99999999999999999999999MB"), Err(UnitError::OutOfRange { .. })));
        assert!(matches!(level("-52.55dBm"), Err(UnitError::TooFine { .. })));
        assert!(matches!(level("75dBm"), Err(UnitError::OutOfRange { .. })));
        assert!(matches!(offset_mm("101km"), Err(UnitError::OutOfRange { .. })));
        assert!(matches!(bit_rate("20MBit/s"), Err(UnitError::UnknownUnit { .. })));
        assert!(matches!(bit_rate("1bit/s"), Err(UnitError::OutOfRange { .. })));
        assert!(matches!(period("0Hz"), Err(UnitError::OutOfRange { .. })));
        let text = size("530Mb").unwrap_err().to_string();
        assert_eq!(text, "`530Mb` has the unknown unit `Mb` (did you mean `MB`?)");
    }

    #[test]
    fn half_a_unit_is_gone_on_with_rather_than_changed() {
        let meant = |error: UnitError| {
            let UnitError::UnknownUnit { meant, .. } = error else { panic!("{error}") };
            meant
        };
        assert_eq!(meant(size("530M").unwrap_err()), Some("MB"));
        assert_eq!(meant(size("1g").unwrap_err()), Some("GB"));
        assert_eq!(meant(distance_mm("3M").unwrap_err()), Some("m"));
        assert_eq!(meant(period("15hz").unwrap_err()), Some("Hz"));
        assert_eq!(meant(size("5XB").unwrap_err()), Some("B"));
    }
}
