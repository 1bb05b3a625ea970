//! Whom this robot speaks with.

use std::cell::RefCell;
use std::collections::BTreeMap;
use std::net::SocketAddr;
use std::rc::Rc;
use std::time::Duration;

use sdr_core::time::Instant;

/// Most addresses that are kept.
const ADDRESSES_MAX: usize = 1024;
/// An address that was not used for so long is forgotten.
const LIFE: Duration = Duration::from_secs(60);

/// Addresses that this robot heard or wrote to within a minute; cheap to clone.
#[derive(Clone, Debug, Default)]
pub(super) struct Addresses(Rc<RefCell<BTreeMap<SocketAddr, Instant>>>);

impl Addresses {
    /// It was used at `now`.
    pub(super) fn note(&self, now: Instant, address: SocketAddr) {
        let mut used = self.0.borrow_mut();
        if used.len() >= ADDRESSES_MAX && !used.contains_key(&address) {
            used.retain(|_, at| now.since(*at) < LIFE);
        }
        if used.len() < ADDRESSES_MAX || used.contains_key(&address) {
            used.insert(address, now);
        }
    }

    /// Whether it was used lately.
    pub(super) fn knows(&self, now: Instant, address: SocketAddr) -> bool {
        self.0.borrow().get(&address).is_some_and(|at| now.since(*at) < LIFE)
    }

    /// All that were used lately.
    pub(super) fn recent(&self, now: Instant) -> Vec<SocketAddr> {
        let used = self.0.borrow();
        used.iter().filter(|(_, at)| now.since(**at) < LIFE).map(|(address, _)| *address).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn old_addresses_make_room_and_a_flood_of_new_ones_finds_none() {
        let addresses = Addresses::default();
        let address = |port: u16| SocketAddr::from(([127, 0, 0, 1], port));
        let start = Instant::from_millis(1);
        for port in 0..2000 {
            addresses.note(start, address(port));
        }
        assert_eq!(addresses.recent(start).len(), ADDRESSES_MAX);
        assert!(addresses.knows(start, address(7)) && !addresses.knows(start, address(1999)));

        let later = start + LIFE;
        addresses.note(later, address(1999));
        assert_eq!(addresses.recent(later), [address(1999)]);
    }
}
