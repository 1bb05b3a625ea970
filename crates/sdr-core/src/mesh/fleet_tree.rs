//! Hashes over the fleet table as a tree by key hash, kept with every change.

use alloc::{vec, vec::Vec};

use super::fact::fold;

/// Deepest level that has hashes of its own: 16^3 nodes.
pub(super) const DEPTH_MAX: u8 = 3;
/// Children of a node.
pub(super) const CHILDREN: u32 = 16;

/// Node hashes by level; empty while the table is.
#[derive(Clone, Debug, Default)]
pub(super) struct FleetTree {
    levels: Vec<Vec<u64>>,
}

impl FleetTree {
    /// An entry comes or goes.
    pub(super) fn toggle(&mut self, key_hash: u32, stamp: u32) {
        if self.levels.is_empty() {
            let nodes = |depth: u32| vec![0; 1 << (4 * depth)];
            self.levels = (0..=u32::from(DEPTH_MAX)).map(nodes).collect();
        }
        let entry = mix(u64::from(key_hash) << 32 | u64::from(stamp));
        for (depth, level) in (0..).zip(&mut self.levels) {
            level[node_of(key_hash, depth)] ^= entry;
        }
    }

    /// Hash over everything.
    pub(super) fn root(&self) -> u32 {
        self.node(0, 0)
    }

    /// Hash over all keys that begin with the `depth` nibbles of `prefix`.
    pub(super) fn node(&self, depth: u8, prefix: u16) -> u32 {
        let level = self.levels.get(usize::from(depth));
        level.and_then(|level| level.get(usize::from(prefix))).map_or(0, |hash| match hash {
            0 => 0,
            hash => fold(*hash),
        })
    }

    /// Hashes of a node's children.
    pub(super) fn children(&self, depth: u8, prefix: u16) -> Vec<u32> {
        let child = |nibble| self.node(depth + 1, prefix << 4 | nibble);
        (0..u16::try_from(CHILDREN).unwrap_or(0)).map(child).collect()
    }
}

/// Least and greatest key hash below a node.
pub(super) fn range_of(depth: u8, prefix: u16) -> (u32, u32) {
    match depth {
        0 => (0, u32::MAX),
        _ => {
            let shift = 32 - 4 * u32::from(depth.min(DEPTH_MAX));
            let low = u32::from(prefix).checked_shl(shift).unwrap_or(0);
            (low, low | ((1 << shift) - 1))
        }
    }
}

fn node_of(key_hash: u32, depth: u32) -> usize {
    let shifted = key_hash.checked_shr(32 - 4 * depth).unwrap_or(0);
    usize::try_from(shifted).unwrap_or(0)
}

fn mix(value: u64) -> u64 {
    let mut mixed = value.wrapping_add(0x9e37_79b9_7f4a_7c15);
    mixed = (mixed ^ (mixed >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
    mixed = (mixed ^ (mixed >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
    mixed ^ (mixed >> 31)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_comes_and_goes_leaves_no_trace() {
        let mut tree = FleetTree::default();
        tree.toggle(0x1234_5678, 9);
        let one = tree.root();
        tree.toggle(0xffff_ffff, 1);
        assert_ne!(tree.root(), one);
        assert_ne!(tree.node(3, 0xfff), 0);
        tree.toggle(0xffff_ffff, 1);
        assert_eq!((tree.root(), tree.node(3, 0xfff)), (one, 0));
        assert_eq!(range_of(3, 0x123), (0x1230_0000, 0x123f_ffff));
    }
}
