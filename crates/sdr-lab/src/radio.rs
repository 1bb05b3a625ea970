//! Radio: path loss, a level that fades when told, and the file an agent reads it from.
//!
//! The path loss is that of the DARPA SubT simulator:
//! `RSSI = tx - (L0 + 10 n log10 d)` with n grown by lost visibility.

use std::io;
use std::path::Path;
use std::time::Duration;

use crate::cast::rounded;
use crate::noise::Noise;

/// Noise floor of a 20 MHz channel, dBm.
pub const NOISE_FLOOR_DBM: f64 = -94.0;
/// Levels a file may show, dBm: what chips report.
const LEVEL_RANGE_DBM: std::ops::RangeInclusive<f64> = -110.0..=-10.0;

/// Path loss at 2.4 GHz.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct PathLoss {
    /// Power sent, dBm.
    pub tx_dbm: f64,
    /// Loss in the first metre, dB.
    pub reference_db: f64,
    /// How fast the level falls: 2 in free space.
    pub exponent: f64,
    /// Added to the exponent for each unit of lost visibility (a corner).
    pub exponent_per_corner: f64,
    /// Beyond this nothing is heard, metres.
    pub range_m: f64,
}

impl PathLoss {
    /// Tunnels and urban sites.
    pub const TUNNEL: Self = Self {
        tx_dbm: 20.0,
        reference_db: 40.0,
        exponent: 2.5,
        exponent_per_corner: 0.2,
        range_m: 500.0,
    };
    /// Straight galleries of caves, which guide the wave.
    pub const GALLERY: Self = Self { exponent: 1.5, ..Self::TUNNEL };

    /// Mean level at a distance; `None` out of range. Nearer than one metre counts as one.
    pub fn level_dbm(&self, distance_m: f64, corners: f64) -> Option<f64> {
        if distance_m.is_nan() || distance_m > self.range_m {
            return None;
        }
        let exponent = self.exponent + self.exponent_per_corner * corners.max(0.0);
        let loss = self.reference_db + 10.0 * exponent * distance_m.max(1.0).log10();
        Some(self.tx_dbm - loss)
    }
}

/// A ramp of the level, linear in time, which stays at its end.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Fade {
    /// Level at the start, dBm.
    pub from_dbm: f64,
    /// Level at the end, dBm.
    pub to_dbm: f64,
    /// From start to end.
    pub over: Duration,
}

impl Fade {
    /// The paper's: a shield of mesh over the robot.
    pub const SHIELD: Self = Self { from_dbm: -47.0, to_dbm: -55.0, over: Duration::from_secs(2) };

    /// Mean level `after` the start.
    pub fn level_dbm(&self, after: Duration) -> f64 {
        if after >= self.over {
            return self.to_dbm;
        }
        let share = after.as_secs_f64() / self.over.as_secs_f64();
        self.from_dbm + (self.to_dbm - self.from_dbm) * share
    }
}

/// The radio of one robot.
#[derive(Debug, Clone)]
pub struct RadioModel {
    level_dbm: f64,
    sigma_db: f64,
    fade: Option<(Duration, Fade)>,
    noise: Noise,
}

impl RadioModel {
    /// A steady level with normal noise.
    pub fn new(level_dbm: f64, sigma_db: f64, noise: Noise) -> Self {
        Self { level_dbm, sigma_db, fade: None, noise }
    }

    /// Starts a fade at `now` (any clock, the same as in [`RadioModel::sample_dbm`]).
    pub fn start_fade(&mut self, now: Duration, fade: Fade) {
        self.fade = Some((now, fade));
    }

    /// The level without noise.
    pub fn mean_dbm(&self, now: Duration) -> f64 {
        match &self.fade {
            Some((start, fade)) => fade.level_dbm(now.saturating_sub(*start)),
            None => self.level_dbm,
        }
    }

    /// One measurement.
    pub fn sample_dbm(&mut self, now: Duration) -> f64 {
        let noise = self.noise.normal(self.sigma_db);
        (self.mean_dbm(now) + noise).clamp(*LEVEL_RANGE_DBM.start(), *LEVEL_RANGE_DBM.end())
    }
}

/// The text of /proc/net/wireless with one interface, as Linux writes it: whole dBm, and a dot
/// after each value that is fresh.
pub fn wireless_text(interface: &str, level_dbm: f64, noise_dbm: f64) -> String {
    let level = rounded(level_dbm);
    // cfg80211 shows the level above -110 dBm as quality, at most 70.
    let quality = (level + 110).clamp(0, 70);
    let noise = rounded(noise_dbm);
    format!(
        "Inter-| sta-|   Quality        |   Discarded packets               | Missed | WE\n \
         face | tus | link level noise |  nwid  crypt   frag  retry   misc | beacon | 22\n\
         {interface:>6}: 0000  {quality:3}.  {level:3}.  {noise:3}.  {:6} {:6} {:6} {:6} {:6}   {:6}\n",
        0, 0, 0, 0, 0, 0
    )
}

/// The text of /sys/class/power_supply/*/capacity: whole percent.
pub fn capacity_text(percent: f64) -> String {
    format!("{}\n", rounded(percent).clamp(0, 100))
}

/// Replaces a file at once: readers see the old or the new text, never a part.
pub fn write_whole(path: &Path, text: &str) -> io::Result<()> {
    let mut beside = path.as_os_str().to_owned();
    beside.push(".new");
    std::fs::write(&beside, text)?;
    std::fs::rename(&beside, path)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_level_falls_by_25_db_for_each_tenfold_distance_in_tunnels() {
        let near = PathLoss::TUNNEL.level_dbm(1.0, 0.0).unwrap();
        let far = PathLoss::TUNNEL.level_dbm(10.0, 0.0).unwrap();

        assert!((near + 20.0).abs() < 1e-9 && (far + 45.0).abs() < 1e-9, "{near} {far}");
        assert_eq!(PathLoss::TUNNEL.level_dbm(0.0, 0.0), Some(near));
        assert_eq!(PathLoss::TUNNEL.level_dbm(500.1, 0.0), None);
        assert_eq!(PathLoss::TUNNEL.level_dbm(f64::NAN, 0.0), None);
    }

    #[test]
    fn a_gallery_carries_farther_and_a_corner_takes_away() {
        let straight = PathLoss::GALLERY.level_dbm(100.0, 0.0).unwrap();

        assert!((straight + 50.0).abs() < 1e-9);
        assert!(PathLoss::TUNNEL.level_dbm(100.0, 0.0).unwrap() < straight);
        let corner = PathLoss::GALLERY.level_dbm(100.0, 2.0).unwrap();
        assert!((straight - corner - 8.0).abs() < 1e-9);
    }

    #[test]
    fn a_fade_is_a_straight_line_that_stays_at_its_end() {
        let mut radio = RadioModel::new(-47.0, 0.5, Noise::new(1));
        let at = |radio: &RadioModel, ms| radio.mean_dbm(Duration::from_millis(ms));
        assert!((at(&radio, 9000) + 47.0).abs() < 1e-9);

        radio.start_fade(Duration::from_secs(10), Fade::SHIELD);

        assert!((at(&radio, 10_000) + 47.0).abs() < 1e-9);
        assert!((at(&radio, 11_000) + 51.0).abs() < 1e-9);
        assert!((at(&radio, 60_000) + 55.0).abs() < 1e-9);
    }

    #[test]
    fn measurements_spread_by_half_a_decibel() {
        let mut radio = RadioModel::new(-47.0, 0.5, Noise::new(1));
        let values: Vec<f64> = (0..5000).map(|_| radio.sample_dbm(Duration::ZERO)).collect();

        let mean = values.iter().sum::<f64>() / values.len() as f64;
        let spread = values.iter().map(|v| (v - mean).powi(2)).sum::<f64>() / values.len() as f64;

        assert!((mean + 47.0).abs() < 0.05 && (spread.sqrt() - 0.5).abs() < 0.05);
    }

    #[test]
    fn the_file_looks_like_the_one_of_linux() {
        let text = wireless_text("wlan0", -47.4, NOISE_FLOOR_DBM);

        let lines: Vec<&str> = text.lines().collect();
        assert_eq!(lines.len(), 3);
        assert!(lines[1].starts_with(" face | tus |"));
        assert_eq!(
            lines[2],
            " wlan0: 0000   63.  -47.  -94.       0      0      0      0      0        0"
        );
        assert_eq!(capacity_text(79.9), "80\n");
        assert_eq!(capacity_text(-1.0), "0\n");
    }
}
