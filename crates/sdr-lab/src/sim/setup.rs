//! How a fleet is made.

use std::time::Duration;

use sdr_core::units::{Bytes, Permille};

use super::Weather;

/// How to set up a fleet.
#[derive(Debug, Clone)]
pub struct Setup {
    /// How many robots.
    pub robots: usize,
    /// Draws everything that is left to chance.
    pub seed: u64,
    /// The radio.
    pub weather: Weather,
    /// Memory of each robot.
    pub memory: Bytes,
    /// CPU of each robot.
    pub cpu: Permille,
    /// Executables each robot can launch.
    pub words: Vec<String>,
    /// Time between two host samples of a robot; default 1 s.
    pub host_period: Duration,
    /// Clocks run fast or slow by at most so many millionths.
    pub drift_ppm_max: usize,
    /// Whether what brains say is kept for stories.
    pub keeps_events: bool,
}

impl Setup {
    /// Robots of 1.9 GB and 4 cores on a fair radio, with perfect clocks.
    pub fn new(robots: usize, seed: u64) -> Self {
        Self {
            robots,
            seed,
            weather: Weather::fair(),
            memory: Bytes::mega(1900),
            cpu: Permille(4000),
            words: vec!["worker".into()],
            host_period: Duration::from_secs(1),
            drift_ppm_max: 0,
            keeps_events: false,
        }
    }
}
