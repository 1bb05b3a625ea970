//! One robot's link to its access point: what is stated of it, and what follows from its level.

use std::time::Duration;

use crate::{
    noise::Noise,
    radio::{Fade, NOISE_FLOOR_DBM, PathLoss},
    sim::Chance,
};

use super::modulation::{Sending, to_all, to_one};

/// Bytes that wait for the air before frames are dropped, by default.
pub const QUEUE_BYTES: usize = 256 * 1024;
/// Level near the access point, dBm: the paper's.
const LEVEL_DBM: f64 = -47.0;
/// Spread of what the driver shows, dB.
const LEVEL_SIGMA_DB: f64 = 0.5;

/// Bursts in which much is lost (Gilbert-Elliott), both times exponential.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Bursts {
    /// Share lost within one.
    pub loss: f64,
    /// Mean time between two.
    pub every: Duration,
    /// Mean time one lasts.
    pub lasting: Duration,
}

/// Changes to a link; `None` leaves what is.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct LinkChange {
    /// Mean level, and the time to get there.
    pub level: Option<(f64, Duration)>,
    /// Share of packets lost, retries or not.
    pub loss: Option<f64>,
    /// Share of single tries that fail, instead of what the level means.
    pub try_loss: Option<f64>,
    /// Bursts; those with a loss of 0 are none.
    pub bursts: Option<Bursts>,
    /// Added to each packet, each way.
    pub delay: Option<Duration>,
    /// Mean of what is added to that, exponential.
    pub jitter: Option<Duration>,
    /// Bits a second, instead of what the level means.
    pub rate: Option<f64>,
    /// Bytes that may wait.
    pub queue_bytes: Option<usize>,
    /// Corners round which it must go.
    pub corners: Option<f64>,
}

/// Where a robot is, or is going.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Way {
    from: (f64, f64),
    to: (f64, f64),
    since: Duration,
    over: Duration,
}

impl Way {
    fn at(&self, now: Duration) -> (f64, f64) {
        let gone = now.saturating_sub(self.since);
        if gone >= self.over {
            return self.to;
        }
        let share = gone.as_secs_f64() / self.over.as_secs_f64();
        let between = |from: f64, to: f64| from + (to - from) * share;
        (between(self.from.0, self.to.0), between(self.from.1, self.to.1))
    }
}

/// See the module.
#[derive(Clone, Debug)]
pub(super) struct Link {
    level: Level,
    way: Way,
    corners: f64,
    pub(super) loss: f64,
    try_loss: Option<f64>,
    bursts: Option<Bursts>,
    burst: (bool, Duration),
    pub(super) delay: Duration,
    pub(super) jitter: Duration,
    rate: Option<f64>,
    pub(super) queue_bytes: usize,
    chance: Chance,
    noise: Noise,
}

/// What makes the level.
#[derive(Clone, Copy, Debug)]
enum Level {
    /// Stated: a ramp from a moment on.
    Stated(Duration, Fade),
    /// Distance and corners.
    Place,
}

impl Link {
    pub(super) fn new(seed: u64, number: u64) -> Self {
        let fade = Fade { from_dbm: LEVEL_DBM, to_dbm: LEVEL_DBM, over: Duration::ZERO };
        let origin = (0.0, 0.0);
        let zero = Duration::ZERO;
        Self {
            level: Level::Stated(zero, fade),
            way: Way { from: origin, to: origin, since: zero, over: zero },
            corners: 0.0,
            loss: 0.0,
            try_loss: None,
            bursts: None,
            burst: (false, zero),
            delay: zero,
            jitter: zero,
            rate: None,
            queue_bytes: QUEUE_BYTES,
            chance: Chance::stream(seed, 2 * number),
            noise: Noise::stream(seed, 2 * number + 1),
        }
    }

    /// Puts the robot somewhere; from now on its level follows from where it is.
    pub(super) fn place(&mut self, now: Duration, to: (f64, f64), over: Duration) {
        let from = if over.is_zero() { to } else { self.way.at(now) };
        self.way = Way { from, to, since: now, over };
        self.level = Level::Place;
    }

    pub(super) fn change(&mut self, now: Duration, change: &LinkChange) {
        if let Some((to_dbm, over)) = change.level {
            // A link out of reach comes back from the noise.
            let from_dbm = self.mean_dbm(now).unwrap_or(NOISE_FLOOR_DBM);
            self.level = Level::Stated(now, Fade { from_dbm, to_dbm, over });
        }
        if let Some(bursts) = change.bursts {
            self.bursts = Some(bursts).filter(|bursts| bursts.loss > 0.0);
            self.burst = (false, now + self.chance.exponential(bursts.every));
        }
        self.loss = change.loss.unwrap_or(self.loss);
        self.try_loss = change.try_loss.or(self.try_loss);
        self.delay = change.delay.unwrap_or(self.delay);
        self.jitter = change.jitter.unwrap_or(self.jitter);
        self.rate = change.rate.or(self.rate);
        self.queue_bytes = change.queue_bytes.unwrap_or(self.queue_bytes);
        self.corners = change.corners.unwrap_or(self.corners);
    }

    /// Where the robot is.
    pub(super) fn position(&self, now: Duration) -> (f64, f64) {
        self.way.at(now)
    }

    /// Mean level; `None` out of reach.
    pub(super) fn mean_dbm(&self, now: Duration) -> Option<f64> {
        match &self.level {
            Level::Stated(since, fade) => Some(fade.level_dbm(now.saturating_sub(*since))),
            Level::Place => {
                let (x, y) = self.way.at(now);
                PathLoss::TUNNEL.level_dbm(x.hypot(y), self.corners)
            }
        }
    }

    /// What the driver shows; `None` out of reach.
    pub(super) fn shown_dbm(&mut self, now: Duration) -> Option<f64> {
        let noise = self.noise.normal(LEVEL_SIGMA_DB);
        let level = self.mean_dbm(now)? + noise;
        // Below the noise nothing is decoded, so nothing is shown.
        (level > NOISE_FLOOR_DBM).then_some(level)
    }

    /// How a frame to the robot or from it goes; `None` out of reach.
    pub(super) fn sending(&self, now: Duration, bytes: usize, all: bool) -> Option<Sending> {
        let snr = self.mean_dbm(now)? - NOISE_FLOOR_DBM;
        let by_level = if all { to_all(snr, bytes) } else { to_one(snr, bytes) };
        Some(Sending {
            bits_per_second: self.rate.unwrap_or(by_level.bits_per_second),
            try_loss: self.try_loss.unwrap_or(by_level.try_loss),
        })
    }

    /// Whether interference takes a packet, retries or not.
    pub(super) fn swallows(&mut self, now: Duration) -> bool {
        let burst = self.burst_loss(now);
        let passes = (1.0 - self.loss) * (1.0 - burst);
        passes < 1.0 && !self.chance.happens(passes)
    }

    /// What is added to one packet.
    pub(super) fn added(&mut self) -> Duration {
        let jitter =
            if self.jitter.is_zero() { self.jitter } else { self.chance.exponential(self.jitter) };
        self.delay + jitter
    }

    fn burst_loss(&mut self, now: Duration) -> f64 {
        let Some(bursts) = self.bursts else { return 0.0 };
        while self.burst.1 <= now {
            let mean = if self.burst.0 { bursts.every } else { bursts.lasting };
            // A mean of zero would never pass the present.
            let next = self.chance.exponential(mean).max(Duration::from_millis(1));
            self.burst = (!self.burst.0, self.burst.1 + next);
        }
        if self.burst.0 { bursts.loss } else { 0.0 }
    }
}
