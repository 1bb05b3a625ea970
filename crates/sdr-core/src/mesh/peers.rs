//! Where other robots can be reached.

use alloc::{collections::BTreeMap, vec::Vec};
use core::net::SocketAddr;

use super::author_table::Seat;
use crate::{rng::Rng, time::Instant};

/// Most addresses kept.
const ADDRESSES_MAX: usize = 4000;

/// An address that nobody alive was heard from.
#[derive(Clone, Copy, Debug, Default)]
struct Stray {
    tried_at: Option<Instant>,
}

/// Addresses, and who was heard from them.
#[derive(Clone, Debug)]
pub(super) struct Peers {
    own: Option<SocketAddr>,
    /// Where the robot of each seat was heard last.
    heard: Vec<Option<SocketAddr>>,
    seats: BTreeMap<SocketAddr, Seat>,
    /// Where nobody was heard yet, or a robot that is gone.
    strays: BTreeMap<SocketAddr, Stray>,
    /// Seats whose turn has not come in this shuffle.
    turn: Vec<Seat>,
    stride: usize,
    edition: u64,
}

impl Peers {
    pub(super) fn new(known: impl Iterator<Item = SocketAddr>, own: Option<SocketAddr>) -> Self {
        let mut peers = Self {
            own,
            heard: Vec::new(),
            seats: BTreeMap::new(),
            strays: BTreeMap::new(),
            turn: Vec::new(),
            stride: 0,
            edition: 0,
        };
        known.for_each(|address| peers.learn(address));
        peers
    }

    /// The robot of `seat` spoke from `address`; another address it used is forgotten.
    pub(super) fn hear(&mut self, seat: Seat, address: SocketAddr) {
        if self.address(seat) == Some(address) && self.seats.get(&address) == Some(&seat) {
            return;
        }
        self.edition += 1;
        if self.heard.len() <= seat.index() {
            self.heard.resize(seat.index() + 1, None);
        }
        if let Some(before) = self.heard[seat.index()].replace(address) {
            self.seats.remove(&before);
        }
        if let Some(other) = self.seats.insert(address, seat).filter(|other| *other != seat) {
            self.heard[other.index()] = None;
        }
        self.strays.remove(&address);
    }

    /// Others say that the robot of `seat`, which never spoke here, is heard from `address`.
    pub(super) fn suppose(&mut self, seat: Seat, address: SocketAddr) {
        let usable = !address.ip().is_unspecified() && address.port() != 0;
        let free = self.address(seat).is_none() && !self.seats.contains_key(&address);
        if usable && free && Some(address) != self.own && self.seats.len() < ADDRESSES_MAX {
            self.hear(seat, address);
        }
    }

    /// Somebody says that a robot can be reached at `address`.
    pub(super) fn learn(&mut self, address: SocketAddr) {
        let usable = !address.ip().is_unspecified() && address.port() != 0;
        let room = self.seats.len() + self.strays.len() < ADDRESSES_MAX;
        if usable && room && Some(address) != self.own && !self.seats.contains_key(&address) {
            self.strays.entry(address).or_default();
        }
    }

    /// The robot of `seat` is gone: its address is tried now and then.
    pub(super) fn lose(&mut self, seat: Seat, now: Instant) {
        let address = self.address(seat);
        if let Some(address) = address {
            self.strays.insert(address, Stray { tried_at: Some(now) });
        }
    }

    pub(super) fn address(&self, seat: Seat) -> Option<SocketAddr> {
        self.heard.get(seat.index()).copied().flatten()
    }

    pub(super) fn seat_at(&self, address: SocketAddr) -> Option<Seat> {
        self.seats.get(&address).copied()
    }

    /// The next of `living`, each once in a shuffled turn.
    pub(super) fn next_in_turn(&mut self, living: &[Seat], rng: &mut Rng) -> Option<Seat> {
        loop {
            while let Some(seat) = self.turn.pop() {
                if self.address(seat).is_some() && living.binary_search(&seat).is_ok() {
                    return Some(seat);
                }
            }
            let reachable = living.iter().filter(|seat| self.address(**seat).is_some());
            self.turn = reachable.copied().collect();
            if self.turn.is_empty() {
                return None;
            }
            for index in (1..self.turn.len()).rev() {
                self.turn.swap(index, rng.below(index + 1));
            }
        }
    }

    /// The robot a doubling stride further in `ring`, a sequence that all robots order alike,
    /// where this robot stands at `own`; `None` when a random one is due.
    pub(super) fn next_by_stride(&mut self, ring: &[Seat], own: usize) -> Option<Seat> {
        let strides = ring.len().next_power_of_two().trailing_zeros();
        let turn = self.stride % (usize::try_from(strides).unwrap_or(0) + 1);
        self.stride = self.stride.wrapping_add(1);
        let stride = 1usize.checked_shl(u32::try_from(turn).unwrap_or(0))?;
        let seat = (stride < ring.len()).then(|| ring[(own + stride) % ring.len()])?;
        self.address(seat).map(|_| seat)
    }

    /// Grows when a robot is heard from another address than before.
    pub(super) fn edition(&self) -> u64 {
        self.edition
    }

    /// A stray address that was never tried, or else, if `again`, the one tried longest ago.
    pub(super) fn next_stray(&mut self, now: Instant, again: bool) -> Option<SocketAddr> {
        let (address, stray) = self.strays.iter_mut().min_by_key(|(_, stray)| stray.tried_at)?;
        if stray.tried_at.is_some() && !again {
            return None;
        }
        stray.tried_at = Some(now);
        Some(*address)
    }

    /// How many robots were heard from an address.
    pub(super) fn count(&self) -> usize {
        self.seats.len()
    }

    /// Addresses that robots were heard from, for the disk and for others.
    pub(super) fn addresses(&self) -> Vec<SocketAddr> {
        self.seats.keys().copied().collect()
    }
}
