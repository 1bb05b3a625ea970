//! Battery and position, from files or from ports.

use std::fs;
use std::path::PathBuf;

use sdr_core::{
    time::Instant,
    units::{Permille, Position},
};

use super::ports::Reading;

/// Where the figures of the body come from; cheap to clone.
#[derive(Clone, Debug, Default)]
pub(crate) struct Sensors {
    /// A file holds the charge in per cent, as /sys/class/power_supply/*/capacity does.
    pub(crate) battery: Option<Source<Permille>>,
    /// A file holds two or three numbers: metres east, north and up in the fleet's frame.
    pub(crate) position: Option<Source<Position>>,
}

/// One figure's source.
#[derive(Clone, Debug)]
pub(crate) enum Source<T> {
    /// Read at each sample.
    File(PathBuf),
    /// Said by a component of this robot.
    Port {
        /// `system.component.port`.
        port: String,
        /// What it said last.
        reading: Reading<T>,
    },
}

impl<T: Copy> Source<T> {
    /// A port that said nothing yet.
    pub(crate) fn of_port(port: impl Into<String>) -> Self {
        Self::Port { port: port.into(), reading: Reading::default() }
    }

    /// The port, when it is one.
    pub(super) fn port(&self) -> Option<&str> {
        match self {
            Self::File(_) => None,
            Self::Port { port, .. } => Some(port),
        }
    }

    /// Where figures of this very port go.
    pub(super) fn reading_of(&self, wanted: &str) -> Option<&Reading<T>> {
        match self {
            Self::Port { port, reading } if port == wanted => Some(reading),
            Self::File(_) | Self::Port { .. } => None,
        }
    }

    fn figure(&self, now: Instant, parse: impl FnOnce(&str) -> Option<T>) -> Option<T> {
        match self {
            Self::File(path) => parse(&fs::read_to_string(path).ok()?),
            Self::Port { reading, .. } => reading.at(now),
        }
    }
}

impl Sensors {
    pub(crate) fn battery(&self, now: Instant) -> Option<Permille> {
        self.battery.as_ref()?.figure(now, parse_battery)
    }

    pub(crate) fn position(&self, now: Instant) -> Option<Position> {
        self.position.as_ref()?.figure(now, parse_position)
    }
}

fn parse_battery(text: &str) -> Option<Permille> {
    let percent: f64 = text.trim().trim_end_matches('%').trim_end().parse().ok()?;
    permille(percent / 100.0)
}

/// `None` for what is no share of a whole.
pub(super) fn permille(share: f64) -> Option<Permille> {
    if !(0.0..=1.0).contains(&share) {
        return None;
    }
    #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "0 to 1000")]
    let permille = (share * 1000.0).round() as u32;
    Some(Permille(permille))
}

fn parse_position(text: &str) -> Option<Position> {
    let mut words = text.split_ascii_whitespace();
    let number = |word: &str| millimetres(word.parse().ok()?);
    let x_mm = number(words.next()?)?;
    let y_mm = number(words.next()?)?;
    let z_mm = words.next().map_or(Some(0), number)?;
    Some(Position { x_mm, y_mm, z_mm })
}

/// `None` for what is no place.
pub(super) fn millimetres(metres: f64) -> Option<i32> {
    let millimetres = (metres * 1000.0).round();
    if millimetres.abs() > 2e9 || millimetres.is_nan() {
        return None;
    }
    #[expect(clippy::cast_possible_truncation, reason = "checked above")]
    let whole = millimetres as i32;
    Some(whole)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_charge_is_a_percentage_or_unknown() {
        assert_eq!(parse_battery("81\n"), Some(Permille(810)));
        assert_eq!(parse_battery(" 79.46 %\n"), Some(Permille(795)));
        for bad in ["", "full", "101", "-1", "NaN"] {
            assert_eq!(parse_battery(bad), None, "{bad:?}");
        }
    }

    #[test]
    fn a_position_is_in_metres() {
        let position = Position { x_mm: 12_500, y_mm: -250, z_mm: 0 };
        assert_eq!(parse_position("12.5 -0.25\n"), Some(position));
        assert_eq!(parse_position("12.5 -0.25 1"), Some(Position { z_mm: 1000, ..position }));
        for bad in ["", "1", "a b", "1e30 0", "1 2 x", "NaN 0"] {
            assert_eq!(parse_position(bad), None, "{bad:?}");
        }
    }
}
