//! The fence at the consumer: tokens accepted by one connection never decrease.

use sdr_core::order::Token;

/// What the fence says to a sample.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Passage {
    /// Its token is older than one accepted before.
    Refused,
    /// Its token is the one accepted last.
    Same,
    /// Its token is greater than all before; from now on older ones are refused.
    Greater,
}

/// Remembers the greatest token accepted by one connection.
#[derive(Clone, Debug, Default)]
pub struct Fence {
    accepted: Option<Token>,
}

impl Fence {
    /// Judges a sample by its token.
    pub fn pass(&mut self, token: &Token) -> Passage {
        match &self.accepted {
            Some(accepted) if token < accepted => Passage::Refused,
            Some(accepted) if token == accepted => Passage::Same,
            Some(_) | None => {
                self.accepted = Some(token.clone());
                Passage::Greater
            }
        }
    }

    /// The greatest token accepted so far.
    pub fn accepted(&self) -> Option<&Token> {
        self.accepted.as_ref()
    }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;
    use sdr_core::{id::RobotId, order::Epoch};

    use super::*;

    fn token(number: u64, robot: u8, run: u32) -> Token {
        let minted_by = RobotId::new(&format!("robot-{robot}")).unwrap();
        Token { epoch: Epoch { number, minted_by }, run }
    }

    #[test]
    fn an_old_home_is_refused_once_the_new_one_was_heard() {
        let mut fence = Fence::default();
        assert_eq!(fence.pass(&token(1, 1, 2)), Passage::Greater);
        assert_eq!(fence.pass(&token(1, 1, 2)), Passage::Same);
        assert_eq!(fence.pass(&token(2, 3, 1)), Passage::Greater);
        assert_eq!(fence.pass(&token(1, 1, 9)), Passage::Refused);
        assert_eq!(fence.accepted(), Some(&token(2, 3, 1)));
    }

    proptest! {
        #[test]
        fn accepted_tokens_never_decrease(
            story in prop::collection::vec((0..5_u64, 1..4_u8, 1..4_u32), 0..60),
        ) {
            let mut fence = Fence::default();
            let mut last: Option<Token> = None;
            for (number, robot, run) in story {
                let token = token(number, robot, run);
                let passage = fence.pass(&token);
                prop_assert_eq!(passage == Passage::Refused, Some(&token) < last.as_ref());
                if passage != Passage::Refused {
                    last = Some(token);
                }
                prop_assert_eq!(fence.accepted(), last.as_ref());
            }
        }
    }
}
