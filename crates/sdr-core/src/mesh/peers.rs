//! Where other robots can be reached.

use alloc::{collections::BTreeMap, vec::Vec};
use core::net::SocketAddr;

use crate::{id::RobotId, rng::Rng};

/// Most addresses kept.
const ADDRESSES_MAX: usize = 2000;

/// Addresses, and who was heard from them.
#[derive(Clone, Debug)]
pub(super) struct Peers {
    own: Option<SocketAddr>,
    addresses: BTreeMap<SocketAddr, Option<RobotId>>,
}

impl Peers {
    pub(super) fn new(known: Vec<SocketAddr>, own: Option<SocketAddr>) -> Self {
        let mut peers = Self { own, addresses: BTreeMap::new() };
        for address in known {
            peers.learn(address);
        }
        peers
    }

    /// `robot` spoke from `address`; another address it used before is forgotten.
    pub(super) fn hear(&mut self, robot: &RobotId, address: SocketAddr) {
        if self.addresses.get(&address).is_some_and(|known| known.as_ref() == Some(robot)) {
            return;
        }
        self.addresses.retain(|_, known| known.as_ref() != Some(robot));
        if self.addresses.len() < ADDRESSES_MAX {
            self.addresses.insert(address, Some(robot.clone()));
        }
    }

    /// Somebody says that a robot can be reached at `address`.
    pub(super) fn learn(&mut self, address: SocketAddr) {
        let usable = !address.ip().is_unspecified() && address.port() != 0;
        if usable && Some(address) != self.own && self.addresses.len() < ADDRESSES_MAX {
            self.addresses.entry(address).or_insert(None);
        }
    }

    /// At most `count` addresses by chance, those that were heard before the others.
    pub(super) fn pick(
        &self,
        count: usize,
        rng: &mut Rng,
        without: &[SocketAddr],
    ) -> Vec<SocketAddr> {
        let allowed = |address: &&SocketAddr| !without.contains(address);
        let by = |heard: bool| {
            let of = self.addresses.iter().filter(move |(_, robot)| robot.is_some() == heard);
            of.map(|(address, _)| address).filter(allowed).copied().collect::<Vec<_>>()
        };
        let (mut heard, mut unheard) = (by(true), by(false));
        let mut picked = Vec::new();
        while picked.len() < count {
            let from = if heard.is_empty() { &mut unheard } else { &mut heard };
            if from.is_empty() {
                break;
            }
            picked.push(from.swap_remove(rng.below(from.len())));
        }
        picked
    }

    /// One address that was never heard, by chance.
    pub(super) fn pick_unheard(&self, rng: &mut Rng) -> Option<SocketAddr> {
        let unheard: Vec<SocketAddr> = self
            .addresses
            .iter()
            .filter(|(_, robot)| robot.is_none())
            .map(|(address, _)| *address)
            .collect();
        unheard.get(rng.below(unheard.len())).copied()
    }

    /// Addresses that were heard, for the disk and for others.
    pub(super) fn addresses(&self) -> Vec<SocketAddr> {
        let heard = self.addresses.iter().filter(|(_, robot)| robot.is_some());
        heard.map(|(address, _)| *address).collect()
    }
}
