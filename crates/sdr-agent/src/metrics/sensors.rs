//! Battery and position from files.

use std::fs;
use std::path::PathBuf;

use sdr_core::units::{Permille, Position};

/// Files that hold what the body senses.
#[derive(Clone, Debug, Default)]
pub(crate) struct Sensors {
    /// Charge in per cent, as in /sys/class/power_supply/*/capacity.
    pub(crate) battery: Option<PathBuf>,
    /// Two or three numbers: metres east, north and up in the fleet's frame.
    pub(crate) position: Option<PathBuf>,
}

impl Sensors {
    pub(super) fn battery(&self) -> Option<Permille> {
        parse_battery(&fs::read_to_string(self.battery.as_ref()?).ok()?)
    }

    pub(super) fn position(&self) -> Option<Position> {
        parse_position(&fs::read_to_string(self.position.as_ref()?).ok()?)
    }
}

fn parse_battery(text: &str) -> Option<Permille> {
    let percent: f64 = text.trim().trim_end_matches('%').trim_end().parse().ok()?;
    if !(0.0..=100.0).contains(&percent) {
        return None;
    }
    #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "0 to 1000")]
    let permille = (percent * 10.0).round() as u32;
    Some(Permille(permille))
}

fn parse_position(text: &str) -> Option<Position> {
    let mut words = text.split_ascii_whitespace();
    let x_mm = millimetres(words.next()?)?;
    let y_mm = millimetres(words.next()?)?;
    let z_mm = words.next().map_or(Some(0), millimetres)?;
    Some(Position { x_mm, y_mm, z_mm })
}

fn millimetres(word: &str) -> Option<i32> {
    let metres: f64 = word.parse().ok()?;
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
