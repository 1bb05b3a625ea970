//! Datagrams under way.

use std::{collections::BTreeMap, net::SocketAddr, time::Duration};

use sdr_core::{rng::Rng, time::Instant};

/// The address of a robot by number.
pub(super) fn address(number: usize) -> SocketAddr {
    let port = 7000 + u16::try_from(number).expect("fleets in tests are small");
    SocketAddr::from(([127, 0, 0, 1], port))
}

pub(super) struct Wire {
    rng: Rng,
    robots: usize,
    flying: BTreeMap<(Instant, u64), (usize, SocketAddr, Vec<u8>)>,
    count: u64,
    /// Of 1000 datagrams so many are lost.
    pub(super) loss: usize,
    /// Robots below this number and the others do not hear each other.
    pub(super) split_at: Option<usize>,
}

impl Wire {
    pub(super) fn new(rng: Rng, robots: usize) -> Self {
        Self { rng, robots, flying: BTreeMap::new(), count: 0, loss: 0, split_at: None }
    }

    pub(super) fn is_linked(&self, from: usize, to: usize) -> bool {
        self.split_at.is_none_or(|first| (from < first) == (to < first))
    }

    pub(super) fn send(&mut self, now: Instant, from: usize, to: SocketAddr, bytes: Vec<u8>) {
        assert!(bytes.len() <= 1200, "a datagram of {} bytes", bytes.len());
        let number = usize::from(to.port().saturating_sub(7000));
        let lost = self.rng.below(1000) < self.loss;
        if lost || number >= self.robots || !self.is_linked(from, number) {
            return;
        }
        let delay = Duration::from_micros(500 + self.rng.below(2000) as u64);
        self.count += 1;
        self.flying.insert((now + delay, self.count), (number, address(from), bytes));
    }

    pub(super) fn next_due(&self) -> Option<Instant> {
        self.flying.keys().next().map(|(at, _)| *at)
    }

    pub(super) fn arrived(&mut self, now: Instant) -> Vec<(usize, SocketAddr, Vec<u8>)> {
        let later = self.flying.split_off(&(now, u64::MAX));
        std::mem::replace(&mut self.flying, later).into_values().collect()
    }
}
