//! From tries to a plan: the first that is whole, else the one that places most.

use alloc::{format, string::String, vec::Vec};

use sdr_core::{
    allocate::{AllocError, Allocator, Homeless, Placement, Plan, Problem, Refusal, Tier},
    spec::PolicyBytes,
};

use crate::{
    attempt::{Approach, Attempt, Bundling, Choose, Order},
    best_score::BestScore,
    explain,
    facts::Facts,
    feasible::Question,
    first_fit::FirstFit,
    policy::{Policy, Strategy},
};

/// Answers a problem by the policy that it carries.
pub fn allocate(problem: &Problem) -> Result<Plan, AllocError> {
    let policy = Policy::decode(&problem.policy)
        .map_err(|_| AllocError::Policy(problem.policy.name.clone()))?;
    Ok(match policy.strategy {
        Strategy::FirstFit => FirstFit::new(policy).allocate(problem),
        Strategy::BestScore => BestScore::new(policy).allocate(problem),
    })
}

/// Whether a policy can be read here; the error is for people.
pub fn check(policy: &PolicyBytes) -> Result<(), String> {
    match Policy::decode(policy) {
        Ok(_) => Ok(()),
        Err(error) => Err(format!("allocation policy `{}`: {error}", policy.name)),
    }
}

/// The plan of one strategy.
pub(crate) fn plan(facts: &Facts<'_>, choose: &impl Choose, name: &str) -> Plan {
    let mut best: Option<Attempt<'_>> = None;
    for approach in approaches(facts) {
        let attempt = Attempt::run(facts, choose, approach);
        if attempt.whole() {
            return written(facts, &attempt, name);
        }
        // In trouble, what is left homeless by the last tier is what counts.
        let better = best.as_ref().is_none_or(|best| {
            attempt.approach.tier != best.approach.tier
                || attempt.board.placed() > best.board.placed()
        });
        if better {
            best = Some(attempt);
        }
    }
    let best = best.expect("there is always at least one approach");
    written(facts, &best, name)
}

/// What is tried, in this order, until one places all.
fn approaches<'a>(facts: &'a Facts<'_>) -> Vec<Approach<'a>> {
    let policy = facts.policy;
    let mut tiers = alloc::vec![(Tier::Strict, &policy.strict)];
    let bundlings: &[Bundling] = match facts.problem.tier {
        Tier::Strict => &[Bundling::Asked],
        Tier::Relaxed => {
            tiers.extend(policy.relaxed.as_ref().map(|bars| (Tier::Relaxed, bars)));
            &[Bundling::Talking, Bundling::Asked]
        }
    };
    let mut approaches = Vec::new();
    for (tier, bars) in tiers {
        for bundling in bundlings {
            for order in [Order::File, Order::LargestFirst, Order::SmallestFirst] {
                approaches.push(Approach { tier, bars, bundling: *bundling, order });
            }
        }
    }
    approaches
}

fn written(facts: &Facts<'_>, attempt: &Attempt<'_>, name: &str) -> Plan {
    let mut plan = Plan { allocator: String::from(name), ..Plan::default() };
    for (item, spec) in facts.problem.items.iter().enumerate() {
        let component = spec.component.clone();
        match (&attempt.board.homes[item], &attempt.made[item]) {
            (Some(robot), Some((memory_left, refusals))) => plan.placements.push(Placement {
                component,
                robot: facts.robots[*robot].robot.clone(),
                tier: attempt.approach.tier,
                memory_left: *memory_left,
                refusals: refusals.clone(),
            }),
            (None, _) | (_, None) => {
                let refusals = why_homeless(facts, attempt, item);
                plan.homeless.push(Homeless { component, refusals });
            }
        }
    }
    plan
}

/// Every robot's reasons, judged when all others are placed.
fn why_homeless(facts: &Facts<'_>, attempt: &Attempt<'_>, item: usize) -> Vec<Refusal> {
    let (board, bars) = (&attempt.board, attempt.approach.bars);
    let mut refusals = Vec::new();
    for robot in 0..facts.robots.len() {
        let question = Question { facts, board, bars, item, robot };
        let failures = question.failures();
        refusals.extend(failures.iter().map(|failure| explain::refusal(question, failure)));
    }
    refusals
}
