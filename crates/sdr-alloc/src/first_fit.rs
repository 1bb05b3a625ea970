//! The paper's first algorithm: ask robots in the order of a list, take the first that fits.

use alloc::vec::Vec;

use sdr_core::allocate::{Allocator, Plan, Problem};

use crate::{
    attempt::Choose,
    board::Board,
    facts::Facts,
    outcome,
    policy::{Millimetres, Policy, StartWith},
};

/// Places each component on the first robot of the list that fits.
#[derive(Clone, Debug)]
pub struct FirstFit {
    policy: Policy,
}

impl FirstFit {
    /// First-fit under `policy`; the policy in a problem is not looked at.
    pub fn new(policy: Policy) -> Self {
        Self { policy }
    }
}

impl Allocator for FirstFit {
    fn name(&self) -> &'static str {
        "first-fit"
    }

    fn allocate(&self, problem: &Problem) -> Plan {
        let facts = Facts::new(problem, &self.policy);
        outcome::plan(&facts, self, self.name())
    }
}

impl Choose for FirstFit {
    fn order(&self, facts: &Facts<'_>) -> Vec<usize> {
        let receiver = facts.robot(&facts.problem.receiver);
        let mut order: Vec<usize> = match &self.policy.start_with {
            StartWith::Receiver => receiver.into_iter().collect(),
            StartWith::List(list) => list.iter().filter_map(|robot| facts.robot(robot)).collect(),
            StartWith::Nearest => {
                let distance = |robot: &usize| match receiver {
                    Some(receiver) if receiver == *robot => Some(Millimetres(0)),
                    Some(receiver) => facts.distance(receiver, *robot),
                    None => None,
                };
                let mut all: Vec<usize> = (0..facts.robots.len()).collect();
                all.sort_by_key(|robot| {
                    (Some(*robot) != receiver, distance(robot).unwrap_or(Millimetres(u64::MAX)))
                });
                all
            }
        };
        let mut listed = alloc::vec![false; facts.robots.len()];
        order.iter().for_each(|robot| listed[*robot] = true);
        order.extend((0..facts.robots.len()).filter(|robot| !listed[*robot]));
        order
    }

    fn score(&self, _: &Facts<'_>, _: &Board, _: usize, _: usize) -> Option<i64> {
        None
    }
}
