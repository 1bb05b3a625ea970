//! The radio between the robots: loss, delay, order, cuts.

use std::{net::SocketAddr, time::Duration};

use sdr_core::time::Instant;

use super::chance::Chance;
use crate::radio::PathLoss;

/// First port; a robot's number is added.
const PORT_FIRST: u16 = 7000;
/// Bytes of the IP and UDP headers and of the seal around each datagram.
pub const FRAME_BYTES: usize = 28 + 32;
/// No place in the field is worse than this, so that all robots stay one fleet.
const PLACE_LOSS_MAX: f64 = 0.5;

/// The address of a robot by number.
pub fn address(number: usize) -> SocketAddr {
    let port = PORT_FIRST.saturating_add(u16::try_from(number).unwrap_or(u16::MAX));
    SocketAddr::from(([127, 0, 0, 1], port))
}

/// The number behind an address.
pub(crate) fn number_of(address: SocketAddr) -> usize {
    usize::from(address.port().saturating_sub(PORT_FIRST))
}

/// What the radio does to every datagram.
#[derive(Debug, Clone, PartialEq)]
pub struct Weather {
    /// Share lost, each datagram for itself.
    pub loss: f64,
    /// Bursts at each receiver (Gilbert-Elliott); none when `burst_loss` is 0.
    pub burst_loss: f64,
    /// Mean time between two bursts.
    pub burst_every: Duration,
    /// Mean time a burst lasts.
    pub burst_for: Duration,
    /// Shortest delay.
    pub delay: Duration,
    /// Mean of what is added to it.
    pub jitter: Duration,
    /// Share that comes much later, behind others.
    pub late: f64,
    /// Share that comes twice.
    pub twice: f64,
}

impl Weather {
    /// A good network: half a millisecond to two and a half, nothing lost.
    pub fn fair() -> Self {
        Self {
            loss: 0.0,
            burst_loss: 0.0,
            burst_every: Duration::from_secs(20),
            burst_for: Duration::from_millis(400),
            delay: Duration::from_micros(500),
            jitter: Duration::from_millis(1),
            late: 0.0,
            twice: 0.0,
        }
    }
}

/// Which direction a cut stops.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Way {
    /// Neither side hears the other.
    Both,
    /// Those inside are not heard outside, but hear.
    Out,
}

/// A wall through the fleet.
#[derive(Debug, Clone)]
pub(crate) struct Cut {
    pub(crate) id: u64,
    pub(crate) inside: Vec<bool>,
    pub(crate) way: Way,
    pub(crate) since: Instant,
    pub(crate) until: Instant,
}

#[derive(Debug, Clone, Copy)]
struct Burst {
    bad: bool,
    until: Instant,
}

/// The radio of the whole fleet.
#[derive(Debug)]
pub(crate) struct Air {
    chance: Chance,
    pub(crate) weather: Weather,
    /// Where the robots stand, metres; empty when places do not matter.
    places: Vec<(f64, f64)>,
    bursts: Vec<Burst>,
    deaf: Vec<Option<(Instant, Instant)>>,
    pub(crate) cuts: Vec<Cut>,
}

impl Air {
    pub(crate) fn new(robots: usize, weather: Weather, chance: Chance) -> Self {
        Self {
            chance,
            weather,
            places: Vec::new(),
            bursts: vec![Burst { bad: false, until: Instant::ZERO }; robots],
            deaf: vec![None; robots],
            cuts: Vec::new(),
        }
    }

    pub(crate) fn place(&mut self, places: Vec<(f64, f64)>) {
        self.places = places;
    }

    /// The level between a robot and the middle of the field, where an access point stands.
    pub(crate) fn level_dbm(&self, robot: usize) -> Option<f64> {
        let (x, y) = self.places.get(robot)?;
        PathLoss::TUNNEL.level_dbm(x.hypot(*y), 0.0)
    }

    pub(crate) fn deafen(&mut self, robot: usize, now: Instant, until: Instant) {
        let since = self.deaf_since(robot, now).unwrap_or(now);
        let until = self.deaf[robot].map_or(until, |(_, before)| before.max(until));
        self.deaf[robot] = Some((since, until));
    }

    pub(crate) fn hear(&mut self, robot: usize, now: Instant) {
        if let Some((_, until)) = &mut self.deaf[robot] {
            *until = now.min(*until);
        }
    }

    pub(crate) fn deaf_since(&self, robot: usize, now: Instant) -> Option<Instant> {
        self.deaf[robot].filter(|(_, until)| now < *until).map(|(since, _)| since)
    }

    /// How long the present deafness of a robot lasts in all.
    pub(crate) fn deaf_for(&self, robot: usize, now: Instant) -> Option<Duration> {
        let (since, until) = self.deaf[robot].filter(|(_, until)| now < *until)?;
        Some(until.since(since))
    }

    pub(crate) fn was_deaf_since(&self, robot: usize, since: Instant) -> bool {
        self.deaf[robot].is_some_and(|(_, until)| until > since)
    }

    /// Whether a datagram can get from one to the other at all.
    pub(crate) fn is_linked(&self, from: usize, to: usize, now: Instant) -> bool {
        self.deaf_since(from, now).is_none()
            && self.deaf_since(to, now).is_none()
            && self.cuts.iter().all(|cut| !cut.stops(from, to))
    }

    /// When the datagram arrives: never, once, or twice.
    pub(crate) fn send(&mut self, now: Instant, from: usize, to: usize) -> [Option<Instant>; 2] {
        if !self.is_linked(from, to, now) || self.loses(now, from, to) {
            return [None, None];
        }
        let first = Some(now + self.delay());
        let again = self.weather.twice > 0.0 && self.chance.happens(self.weather.twice);
        [first, again.then(|| now + self.delay())]
    }

    /// Whether chance takes one datagram on a link that works.
    pub(crate) fn loses(&mut self, now: Instant, from: usize, to: usize) -> bool {
        let place = self.place_loss(from, to);
        let burst = self.burst_loss(now, to);
        let passes = (1.0 - self.weather.loss) * (1.0 - place) * (1.0 - burst);
        passes < 1.0 && !self.chance.happens(passes)
    }

    fn delay(&mut self) -> Duration {
        let jitter = self.chance.exponential(self.weather.jitter);
        let late = self.weather.late > 0.0 && self.chance.happens(self.weather.late);
        let behind =
            if late { self.chance.exponential(self.weather.jitter * 20) } else { Duration::ZERO };
        self.weather.delay + jitter + behind
    }

    /// Loss by path loss: half of all at 7 dB over the noise, falling by e for each 2 dB more.
    fn place_loss(&self, from: usize, to: usize) -> f64 {
        let (Some(a), Some(b)) = (self.places.get(from), self.places.get(to)) else { return 0.0 };
        let level = PathLoss::TUNNEL.level_dbm((a.0 - b.0).hypot(a.1 - b.1), 0.0);
        let over = level.unwrap_or(crate::radio::NOISE_FLOOR_DBM) - crate::radio::NOISE_FLOOR_DBM;
        (1.0 / (1.0 + ((over - 7.0) / 2.0).exp())).min(PLACE_LOSS_MAX)
    }

    fn burst_loss(&mut self, now: Instant, to: usize) -> f64 {
        if self.weather.burst_loss <= 0.0 {
            return 0.0;
        }
        while self.bursts[to].until <= now {
            let bad = !self.bursts[to].bad;
            let mean = if bad { self.weather.burst_for } else { self.weather.burst_every };
            let until =
                self.bursts[to].until + self.chance.exponential(mean) + Duration::from_millis(1);
            self.bursts[to] = Burst { bad, until };
        }
        if self.bursts[to].bad { self.weather.burst_loss } else { 0.0 }
    }
}

impl Cut {
    pub(crate) fn stops(&self, from: usize, to: usize) -> bool {
        let (from, to) = (self.inside[from], self.inside[to]);
        match self.way {
            Way::Both => from != to,
            Way::Out => from && !to,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn air(weather: Weather) -> Air {
        Air::new(4, weather, Chance::new(1))
    }

    fn arrived(air: &mut Air, from: usize, to: usize) -> usize {
        let sent = |n| Instant::from_millis(n);
        (0..10_000).filter(|n| air.send(sent(*n), from, to)[0].is_some()).count()
    }

    #[test]
    fn the_share_lost_is_the_share_asked_for() {
        let lost = 10_000 - arrived(&mut air(Weather { loss: 0.1, ..Weather::fair() }), 0, 1);
        assert!((900..1100).contains(&lost), "{lost}");
    }

    #[test]
    fn bursts_take_their_share_of_time() {
        let weather = Weather {
            burst_loss: 1.0,
            burst_every: Duration::from_millis(90),
            burst_for: Duration::from_millis(10),
            ..Weather::fair()
        };
        let lost = 10_000 - arrived(&mut air(weather), 0, 1);
        assert!((500..2000).contains(&lost), "{lost}");
    }

    #[test]
    fn a_cut_one_way_lets_the_other_way_through() {
        let mut air = air(Weather::fair());
        let inside = vec![true, false, false, false];
        air.cuts.push(Cut {
            id: 1,
            inside,
            way: Way::Out,
            since: Instant::ZERO,
            until: Instant::from_millis(1),
        });

        let now = Instant::ZERO;
        assert!(!air.is_linked(0, 1, now) && air.is_linked(1, 0, now) && air.is_linked(1, 2, now));
    }

    #[test]
    fn a_deaf_robot_is_cut_off_until_its_time_is_over() {
        let mut air = air(Weather::fair());
        air.deafen(2, Instant::ZERO, Instant::from_millis(10));

        assert!(!air.is_linked(2, 1, Instant::from_millis(9)));
        assert!(!air.is_linked(1, 2, Instant::from_millis(9)));
        assert!(air.is_linked(1, 2, Instant::from_millis(10)));
    }
}
