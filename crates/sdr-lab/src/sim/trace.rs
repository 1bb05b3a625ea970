//! One number for everything that happened: equal runs have equal ones.

use sdr_core::time::Instant;

/// Hash of what brains did, in order.
#[derive(Debug, Clone)]
pub(crate) struct Trace(u64);

impl Trace {
    pub(crate) fn new() -> Self {
        Self(0xcbf2_9ce4_8422_2325)
    }

    /// Something was done by a robot.
    pub(crate) fn note(&mut self, now: Instant, robot: usize, what: &[u8]) {
        self.add(now.as_nanos());
        self.add(robot as u64);
        let mut chunks = what.chunks_exact(8);
        for chunk in &mut chunks {
            let mut word = [0; 8];
            word.copy_from_slice(chunk);
            self.add(u64::from_le_bytes(word));
        }
        let rest = chunks.remainder().iter().fold(1, |rest, byte| rest << 8 | u64::from(*byte));
        self.add(rest);
    }

    pub(crate) fn hash(&self) -> u64 {
        self.0
    }

    fn add(&mut self, word: u64) {
        self.0 = (self.0.rotate_left(5) ^ word).wrapping_mul(0x517c_c1b7_2722_0a95);
    }
}
