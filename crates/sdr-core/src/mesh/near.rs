//! Some of the living, by chance.

use alloc::vec::Vec;
use core::net::SocketAddr;

use super::{Mesh, author_table::Seat};
use crate::rng::Rng;

/// Addresses of the living, kept until one of them changes.
#[derive(Clone, Debug, Default)]
pub(super) struct Near {
    /// By seat.
    peers: Vec<(Seat, SocketAddr)>,
    edition: Option<(u64, u64)>,
}

impl Mesh {
    /// At most `count` addresses of the living but those `without`, each once, by chance.
    pub(super) fn pick(&mut self, count: usize, without: &[SocketAddr]) -> Vec<SocketAddr> {
        let edition = Some((self.liveness.edition(), self.peers.edition()));
        if self.near.edition != edition {
            let living = self.liveness.living();
            let peers = living.filter_map(|(seat, _)| Some((seat, self.peers.address(seat)?)));
            self.near = Near { peers: peers.collect(), edition };
        }
        let near = &self.near.peers;
        let left_out = without.iter().filter_map(|out| self.peers.seat_at(*out));
        let left_out = left_out.map(|out| near.binary_search_by_key(&out, |(seat, _)| *seat));
        let mut left_out: Vec<usize> = left_out.filter_map(Result::ok).collect();
        left_out.sort_unstable();
        left_out.dedup();
        let picked = draw(near.len() - left_out.len(), count, &mut self.rng);
        let place =
            |drawn: usize| left_out.iter().fold(drawn, |at, out| at + usize::from(*out <= at));
        picked.into_iter().map(|drawn| near[place(drawn)].1).collect()
    }
}

/// `count` different numbers below `of`: the last one left takes the place of each that is
/// drawn, without a list of all.
fn draw(of: usize, count: usize, rng: &mut Rng) -> Vec<usize> {
    let mut moved: Vec<(usize, usize)> = Vec::new();
    let mut drawn = Vec::new();
    let at = |moved: &[(usize, usize)], place: usize| {
        moved.iter().rev().find(|(to, _)| *to == place).map_or(place, |(_, what)| *what)
    };
    for left in (1..=of).rev().take(count) {
        let place = rng.below(left);
        drawn.push(at(&moved, place));
        moved.push((place, at(&moved, left - 1)));
    }
    drawn
}

#[cfg(test)]
mod tests {
    use alloc::collections::BTreeSet;

    use super::*;

    #[test]
    fn each_number_is_drawn_once_and_all_when_all_are_asked_for() {
        let mut rng = Rng::new(1);
        for of in 0..20 {
            for count in 0..22 {
                let drawn = draw(of, count, &mut rng);
                let distinct: BTreeSet<usize> = drawn.iter().copied().collect();
                assert_eq!((drawn.len(), distinct.len()), (count.min(of), count.min(of)));
                assert!(drawn.iter().all(|number| *number < of));
            }
        }
    }
}
