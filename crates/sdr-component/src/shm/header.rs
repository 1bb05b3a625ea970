//! What every sample carries beside its payload.

use sdr_core::{
    id::RobotId,
    order::{Epoch, Token},
};

pub use crate::sys::SampleHeader;

impl SampleHeader {
    /// Set in `flags` by the bridge on what it injects; the bridge never forwards such samples.
    pub const INJECTED: u32 = 1;

    /// A header for samples under `token`, with everything else zero.
    pub fn new(token: &Token) -> Self {
        let mut minted_by = [0; 32];
        let name = token.epoch.minted_by.as_str().as_bytes();
        minted_by[..name.len()].copy_from_slice(name);
        Self {
            epoch: token.epoch.number,
            minted_by,
            run: token.run,
            flags: 0,
            sequence: 0,
            tick: 0,
            source_time_ns: 0,
        }
    }

    /// The token it carries; `None` when the robot's name is none (a broken producer).
    pub fn token(&self) -> Option<Token> {
        let end = self.minted_by.iter().position(|&byte| byte == 0).unwrap_or(32);
        let name = std::str::from_utf8(&self.minted_by[..end]).ok()?;
        let minted_by = RobotId::new(name).ok()?;
        Some(Token { epoch: Epoch { number: self.epoch, minted_by }, run: self.run })
    }

    /// Whether a bridge put it here.
    pub fn is_injected(&self) -> bool {
        self.flags & Self::INJECTED != 0
    }

    /// Whether it carries the same token as `other`; cheaper than two [`Self::token`].
    pub fn same_token(&self, other: &Self) -> bool {
        (self.epoch, self.run, self.minted_by) == (other.epoch, other.run, other.minted_by)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_token_survives_the_header_with_the_longest_name() {
        for name in ["r", "robot-1", &"a".repeat(32)] {
            let epoch = Epoch { number: 9, minted_by: RobotId::new(name).unwrap() };
            let token = Token { epoch, run: 2 };
            assert_eq!(SampleHeader::new(&token).token(), Some(token));
        }
    }

    #[test]
    fn a_header_with_a_broken_name_has_no_token() {
        let token = Token { epoch: Epoch::first(&RobotId::new("r").unwrap()), run: 1 };
        let header = SampleHeader { minted_by: [0xff; 32], ..SampleHeader::new(&token) };
        assert_eq!(header.token(), None);
    }
}
