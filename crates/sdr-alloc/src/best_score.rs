//! The paper's second algorithm: ask all robots, take the one with the greatest score.

use alloc::vec::Vec;

use sdr_core::allocate::{Allocator, Plan, Problem};

use crate::{attempt::Choose, board::Board, facts::Facts, outcome, policy::Policy, score};

/// Places each component on the robot with the greatest weighted score; among equals the first
/// by name.
#[derive(Clone, Debug)]
pub struct BestScore {
    policy: Policy,
}

impl BestScore {
    /// Best-score under `policy`; the policy in a problem is not looked at.
    pub fn new(policy: Policy) -> Self {
        Self { policy }
    }
}

impl Allocator for BestScore {
    fn name(&self) -> &'static str {
        "best-score"
    }

    fn allocate(&self, problem: &Problem) -> Plan {
        let facts = Facts::new(problem, &self.policy);
        outcome::plan(&facts, self, self.name())
    }
}

impl Choose for BestScore {
    fn order(&self, facts: &Facts<'_>) -> Vec<usize> {
        (0..facts.robots.len()).collect()
    }

    fn score(&self, facts: &Facts<'_>, board: &Board, item: usize, robot: usize) -> Option<i64> {
        Some(score::score(facts, board, item, robot))
    }
}
