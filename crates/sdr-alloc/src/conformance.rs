//! What every [`Allocator`] promises, as one check: for ours, for plug-ins, for yours.

use alloc::{string::ToString, vec::Vec};

use sdr_core::{
    allocate::{Allocator, Plan, Problem, Refusal, Tier},
    id::{ComponentKey, RobotId},
};
use thiserror::Error;

use crate::{
    board::Board,
    explain,
    facts::Facts,
    feasible::Question,
    policy::{Bars, Policy},
};

/// A promise that an allocator does not keep. Its author can mend it.
#[derive(Clone, Debug, PartialEq, Eq, Error)]
#[non_exhaustive]
pub enum Broken {
    /// The same problem twice, two answers.
    #[error("equal problems get different plans")]
    NotDeterministic,
    /// The plan depends on the order in which robots or pairs are listed.
    #[error("the plan depends on the order of robots or pairs in the problem")]
    DependsOnOrder,
    /// The plan does not carry the allocator's name.
    #[error("the plan is signed `{found}`")]
    Signature {
        /// The name it carries.
        found: alloc::string::String,
    },
    /// An item stands in the plan not once, or not in the order of the items.
    #[error("{0} is not in the plan exactly once, or out of order")]
    NotOnce(ComponentKey),
    /// A home that is not on offer.
    #[error("{component} goes to {robot}, which is not on offer")]
    UnknownRobot {
        /// The item.
        component: ComponentKey,
        /// Its home.
        robot: RobotId,
    },
    /// A placement crosses a bar of its tier.
    #[error("{component} goes over a bar: {refusal}")]
    OverBar {
        /// The item.
        component: ComponentKey,
        /// The bar.
        refusal: alloc::string::String,
    },
    /// A tier that the problem does not allow.
    #[error("{0} is placed under relaxed bars, which the problem does not allow")]
    Tier(ComponentKey),
    /// An item without a home although a robot would take it.
    #[error("{component} is homeless, but {robot} would take it")]
    WouldFit {
        /// The item.
        component: ComponentKey,
        /// The robot.
        robot: RobotId,
    },
    /// A robot that has no home to give and gives no reason.
    #[error("{component} is homeless, and nothing is said of {robot}")]
    NoReason {
        /// The item.
        component: ComponentKey,
        /// The robot.
        robot: RobotId,
    },
}

/// Asks `allocator`, which works by `policy`, for a plan of `problem` and checks all promises:
/// determinism, independence of the order of robots, every item once, no bar crossed, no home
/// withheld, a reason for every refusal.
pub fn check(allocator: &dyn Allocator, policy: &Policy, problem: &Problem) -> Result<(), Broken> {
    let plan = allocator.allocate(problem);
    if plan != allocator.allocate(problem) {
        return Err(Broken::NotDeterministic);
    }
    let mut turned = problem.clone();
    turned.robots.reverse();
    turned.pairs.reverse();
    turned.settled.reverse();
    if plan != allocator.allocate(&turned) {
        return Err(Broken::DependsOnOrder);
    }
    if plan.allocator != allocator.name() {
        return Err(Broken::Signature { found: plan.allocator });
    }
    check_plan(policy, problem, &plan)
}

/// Checks a plan by itself, whoever made it.
pub fn check_plan(policy: &Policy, problem: &Problem, plan: &Plan) -> Result<(), Broken> {
    check_once(problem, plan)?;
    let facts = Facts::new(problem, policy);
    let mut board = Board::new(&facts);
    let mut tiers = alloc::vec![Tier::Strict; problem.items.len()];
    for placement in &plan.placements {
        let component = placement.component.clone();
        let item = index_of(problem, &component).ok_or(Broken::NotOnce(component.clone()))?;
        let Some(robot) = facts.robot(&placement.robot) else {
            return Err(Broken::UnknownRobot { component, robot: placement.robot.clone() });
        };
        if placement.tier == Tier::Relaxed && problem.tier == Tier::Strict {
            return Err(Broken::Tier(component));
        }
        tiers[item] = placement.tier;
        board.place(item, robot, facts.needs[item]);
    }
    for (item, spec) in problem.items.iter().enumerate() {
        let Some(robot) = board.homes[item] else { continue };
        board.lift(item, facts.needs[item]);
        let bars = bars_of(policy, tiers[item]);
        if let Some(refusal) = refusals(&facts, &board, bars, (item, robot)).first() {
            let (component, refusal) = (spec.component.clone(), refusal.to_string());
            return Err(Broken::OverBar { component, refusal });
        }
        board.place(item, robot, facts.needs[item]);
    }
    check_homeless(&facts, &board, plan)
}

/// The plan lists the items in their order, each once.
fn check_once(problem: &Problem, plan: &Plan) -> Result<(), Broken> {
    let placed = plan.placements.iter().map(|placement| &placement.component);
    let homeless = plan.homeless.iter().map(|homeless| &homeless.component);
    for item in &problem.items {
        let count = placed.clone().chain(homeless.clone()).filter(|key| **key == item.component);
        if count.count() != 1 {
            return Err(Broken::NotOnce(item.component.clone()));
        }
    }
    let order = |key: &ComponentKey| index_of(problem, key);
    if !placed.clone().is_sorted_by_key(order) || !homeless.clone().is_sorted_by_key(order) {
        let first = plan.placements.first().map(|placement| placement.component.clone());
        let first = first.or_else(|| plan.homeless.first().map(|home| home.component.clone()));
        return first.map_or(Ok(()), |first| Err(Broken::NotOnce(first)));
    }
    match placed.chain(homeless).find(|key| index_of(problem, key).is_none()) {
        Some(stranger) => Err(Broken::NotOnce(stranger.clone())),
        None => Ok(()),
    }
}

fn check_homeless(facts: &Facts<'_>, board: &Board, plan: &Plan) -> Result<(), Broken> {
    let bars = bars_of(facts.policy, facts.problem.tier);
    for homeless in &plan.homeless {
        let component = homeless.component.clone();
        let item = index_of(facts.problem, &component).ok_or(Broken::NotOnce(component.clone()))?;
        for (robot, offer) in facts.robots.iter().enumerate() {
            let (component, id) = (component.clone(), offer.robot.clone());
            if refusals(facts, board, bars, (item, robot)).is_empty() {
                return Err(Broken::WouldFit { component, robot: id });
            }
            if !homeless.refusals.iter().any(|refusal| refusal.robot == id) {
                return Err(Broken::NoReason { component, robot: id });
            }
        }
    }
    Ok(())
}

fn refusals(
    facts: &Facts<'_>,
    board: &Board,
    bars: &Bars,
    (item, robot): (usize, usize),
) -> Vec<Refusal> {
    let question = Question { facts, board, bars, item, robot };
    question.failures().iter().map(|failure| explain::refusal(question, failure)).collect()
}

fn bars_of(policy: &Policy, tier: Tier) -> &Bars {
    match tier {
        Tier::Strict => &policy.strict,
        Tier::Relaxed => policy.relaxed.as_ref().unwrap_or(&policy.strict),
    }
}

fn index_of(problem: &Problem, component: &ComponentKey) -> Option<usize> {
    problem.items.iter().position(|item| item.component == *component)
}
