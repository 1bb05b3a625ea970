//! Quantities with their unit in the type.

use core::fmt;

use serde::{Deserialize, Serialize};

/// An amount of memory or storage in bytes.
#[derive(
    Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, Deserialize,
)]
#[serde(transparent)]
pub struct Bytes(pub u64);

impl Bytes {
    /// `mega` times 10^6 bytes.
    pub const fn mega(mega: u64) -> Self {
        Self(mega.saturating_mul(1_000_000))
    }

    /// This amount less `other`, never below zero.
    pub const fn less(self, other: Self) -> Self {
        Self(self.0.saturating_sub(other.0))
    }

    /// This amount and `other` together.
    pub const fn plus(self, other: Self) -> Self {
        Self(self.0.saturating_add(other.0))
    }
}

impl fmt::Display for Bytes {
    /// Whole megabytes (10^6), as an operator reads them; below 10 MB with one decimal.
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self.0 {
            0 => write!(f, "0 MB"),
            small if small < 10_000_000 => {
                write!(f, "{}.{} MB", small / 1_000_000, small / 100_000 % 10)
            }
            large => write!(f, "{} MB", large / 1_000_000),
        }
    }
}

/// A share in thousandths. CPU is counted in thousandths of one core, so four busy cores
/// are 4000; battery charge lies in 0..=1000.
#[derive(
    Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, Deserialize,
)]
#[serde(transparent)]
pub struct Permille(pub u32);

impl Permille {
    /// This share less `other`, never below zero.
    pub const fn less(self, other: Self) -> Self {
        Self(self.0.saturating_sub(other.0))
    }

    /// This share and `other` together.
    pub const fn plus(self, other: Self) -> Self {
        Self(self.0.saturating_add(other.0))
    }
}

impl fmt::Display for Permille {
    /// As per cent with at most one decimal.
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self.0 % 10 {
            0 => write!(f, "{} %", self.0 / 10),
            tenth => write!(f, "{}.{} %", self.0 / 10, tenth),
        }
    }
}

/// A radio level in tenths of a dBm: -52.5 dBm is `Dbm::from_tenths(-525)`.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, Deserialize)]
#[serde(transparent)]
pub struct Dbm(i16);

impl Dbm {
    /// A level of `tenths` tenths of a dBm.
    pub const fn from_tenths(tenths: i16) -> Self {
        Self(tenths)
    }

    /// The level in tenths of a dBm.
    pub const fn tenths(self) -> i16 {
        self.0
    }

    /// The level in dBm, for people and JSON.
    pub fn as_f64(self) -> f64 {
        f64::from(self.0) / 10.0
    }
}

impl fmt::Display for Dbm {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let sign = if self.0 < 0 { "-" } else { "" };
        let size = self.0.unsigned_abs();
        write!(f, "{sign}{}.{} dBm", size / 10, size % 10)
    }
}

/// A place in the fleet's common frame, in millimetres.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct Position {
    /// East of the frame's origin, mm.
    pub x_mm: i32,
    /// North of the frame's origin, mm.
    pub y_mm: i32,
    /// Above the frame's origin, mm.
    pub z_mm: i32,
}

impl Position {
    /// Straight distance to `other`, mm, rounded down.
    pub fn distance_mm(self, other: Self) -> u64 {
        let square = |a: i32, b: i32| {
            let difference = i64::from(a).abs_diff(i64::from(b));
            u128::from(difference) * u128::from(difference)
        };
        let sum = square(self.x_mm, other.x_mm)
            + square(self.y_mm, other.y_mm)
            + square(self.z_mm, other.z_mm);
        u64::try_from(sum.isqrt()).unwrap_or(u64::MAX)
    }
}

#[cfg(test)]
mod tests {
    use alloc::string::ToString;

    use super::*;

    #[test]
    fn quantities_read_as_an_operator_writes_them() {
        assert_eq!(Bytes::mega(312).to_string(), "312 MB");
        assert_eq!(Bytes(5_430_000).to_string(), "5.4 MB");
        assert_eq!(Permille(812).to_string(), "81.2 %");
        assert_eq!(Permille(4000).to_string(), "400 %");
        assert_eq!(Dbm::from_tenths(-525).to_string(), "-52.5 dBm");
        assert_eq!(Dbm::from_tenths(-5).to_string(), "-0.5 dBm");
    }

    #[test]
    fn distance_survives_the_far_corners_of_the_frame() {
        let far = Position { x_mm: i32::MAX, y_mm: i32::MAX, z_mm: i32::MAX };
        let other = Position { x_mm: i32::MIN, y_mm: i32::MIN, z_mm: i32::MIN };
        assert!(far.distance_mm(other) > 7_000_000_000);
        assert_eq!(Position::default().distance_mm(Position { x_mm: 3, y_mm: 4, z_mm: 0 }), 5);
    }
}
