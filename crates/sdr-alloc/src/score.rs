//! How good a robot is for a component: weighted terms in whole numbers, so that every robot
//! of a fleet comes to the same answer.

use alloc::vec::Vec;

use sdr_core::units::Dbm;

use crate::{
    board::Board,
    facts::{Facts, Partner},
    policy::{Millimetres, Weight, Weights},
};

/// The whole of a term.
const ONE: i64 = 1000;
/// Level at which a link is worth nothing.
const WEAK_TENTHS: i64 = -900;
/// Level at which a link cannot get better.
const STRONG_TENTHS: i64 = -400;
/// Distance at which nearness is worth one half.
const HALF_WAY_MM: u64 = 50_000;

/// The weighted sum for an item that has no home yet, in thousandths.
pub(crate) fn score(facts: &Facts<'_>, board: &Board, item: usize, robot: usize) -> i64 {
    let Weights { memory_left, cpu_left, battery, link_quality, nearness, stay } =
        facts.policy.weights;
    let weighted = |weight: Weight, term: i64| i64::from(weight.0) * term / ONE;
    weighted(memory_left, memory_term(facts, board, item, robot))
        + weighted(cpu_left, cpu_term(facts, board, item, robot))
        + weighted(battery, facts.battery(robot).map_or(0, |charge| i64::from(charge.0.min(1000))))
        + weighted(link_quality, link_term(facts, board, item, robot))
        + weighted(nearness, nearness_term(facts, board, item, robot))
        + weighted(stay, stay_term(facts, item, robot))
}

fn memory_term(facts: &Facts<'_>, board: &Board, item: usize, robot: usize) -> i64 {
    let most = facts.robots.iter().map(|offer| offer.memory_free.0).max().unwrap_or(0).max(1);
    let left = board.memory_left(facts, robot, facts.needs[item].memory).max(0);
    i64::try_from(left * i128::from(ONE) / i128::from(most)).unwrap_or(ONE).min(ONE)
}

fn cpu_term(facts: &Facts<'_>, board: &Board, item: usize, robot: usize) -> i64 {
    let capacity = u64::from(facts.robots[robot].cpu_capacity.0);
    let used = board.cpu_used(facts, robot, facts.needs[item].cpu.0);
    let left = capacity.saturating_sub(used);
    i64::try_from(left * 1000 / capacity.max(1)).unwrap_or(ONE).min(ONE)
}

/// Mean over its connections; one on the same robot is perfect, one whose far end is not known
/// yet counts with the robot's own level.
fn link_term(facts: &Facts<'_>, board: &Board, item: usize, robot: usize) -> i64 {
    let quality = |level: Option<Dbm>| {
        let above = level.map_or(0, |level| i64::from(level.tenths()) - WEAK_TENTHS);
        (above * ONE / (STRONG_TENTHS - WEAK_TENTHS)).clamp(0, ONE)
    };
    let partner = |partner: &Partner| match board.far_end(*partner) {
        Some(far) if far == robot => ONE,
        Some(far) => quality(facts.rssi(robot).zip(facts.rssi(far)).map(|(a, b)| a.min(b))),
        None => quality(facts.rssi(robot)),
    };
    mean(facts.partners[item].iter().map(partner).collect()).unwrap_or(ONE)
}

/// Mean over the connections whose far end is known; without any, nearness to the robot that
/// received the file.
fn nearness_term(facts: &Facts<'_>, board: &Board, item: usize, robot: usize) -> i64 {
    let near = |far: usize| {
        if far == robot {
            return ONE;
        }
        let Some(Millimetres(distance)) = facts.distance(robot, far) else {
            return 0;
        };
        let share = HALF_WAY_MM * 1000 / (HALF_WAY_MM.saturating_add(distance));
        i64::try_from(share).unwrap_or(0)
    };
    let far_ends = facts.partners[item].iter().filter_map(|partner| board.far_end(*partner));
    mean(far_ends.map(near).collect())
        .or_else(|| facts.robot(&facts.problem.receiver).map(near))
        .unwrap_or(ONE)
}

fn stay_term(facts: &Facts<'_>, item: usize, robot: usize) -> i64 {
    let runs = facts.problem.items[item].running_on.contains(&facts.robots[robot].robot);
    if runs { ONE } else { 0 }
}

fn mean(terms: Vec<i64>) -> Option<i64> {
    let count = i64::try_from(terms.len()).ok().filter(|count| *count > 0)?;
    Some(terms.iter().sum::<i64>() / count)
}
