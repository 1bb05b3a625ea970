//! The conformance check sees allocators that break their promises.

mod build;

use std::cell::Cell;

use build::{first_fit, item, offer, problem, robot_id};
use sdr_alloc::{
    Bars, FirstFit,
    conformance::{Broken, check},
};
use sdr_core::{
    allocate::{Allocator, Plan, Problem, Tier},
    units::Bytes,
};

/// First-fit, with its plan spoilt.
struct Spoilt<F: Fn(&Problem, &mut Plan)>(F);

impl<F: Fn(&Problem, &mut Plan)> Allocator for Spoilt<F> {
    fn name(&self) -> &'static str {
        "first-fit"
    }

    fn allocate(&self, problem: &Problem) -> Plan {
        let bars = Bars { memory_free_at_least: Some(Bytes::mega(500)), ..Bars::none() };
        let mut plan = FirstFit::new(first_fit(bars)).allocate(problem);
        (self.0)(problem, &mut plan);
        plan
    }
}

/// Three components on two robots that hold one each.
fn verdict(spoil: impl Fn(&Problem, &mut Plan)) -> Result<(), Broken> {
    let bars = Bars { memory_free_at_least: Some(Bytes::mega(500)), ..Bars::none() };
    let policy = first_fit(bars);
    let mut robots = vec![offer("robot-1"), offer("robot-2")];
    robots.iter_mut().for_each(|robot| robot.memory_free = Bytes::mega(1100));
    let items = ["a", "b", "c"].map(item).to_vec();
    check(&Spoilt(spoil), &policy, &problem(&policy, robots, items))
}

#[test]
fn an_honest_plan_passes() {
    assert_eq!(verdict(|_, _| {}), Ok(()));
}

#[test]
fn a_plan_that_changes_by_itself_or_by_the_order_of_robots_is_seen() {
    let calls = Cell::new(0);
    let moody = |_: &Problem, plan: &mut Plan| {
        calls.set(calls.get() + 1);
        plan.placements.truncate(calls.get());
    };
    assert_eq!(verdict(moody), Err(Broken::NotDeterministic));

    let by_order = |problem: &Problem, plan: &mut Plan| {
        plan.placements[0].robot = problem.robots[0].robot.clone();
    };
    assert_eq!(verdict(by_order), Err(Broken::DependsOnOrder));
}

#[test]
fn a_plan_that_forgets_invents_or_overfills_is_seen() {
    let forgets = verdict(|_, plan| drop(plan.homeless.pop()));
    assert!(matches!(forgets, Err(Broken::NotOnce(_))), "{forgets:?}");

    let invents = verdict(|_, plan| plan.placements[0].robot = robot_id("robot-9"));
    assert!(matches!(invents, Err(Broken::UnknownRobot { .. })), "{invents:?}");

    let overfills = verdict(|_, plan| plan.placements[1].robot = robot_id("robot-1"));
    assert!(matches!(overfills, Err(Broken::OverBar { .. })), "{overfills:?}");

    let relaxes = verdict(|_, plan| plan.placements[1].tier = Tier::Relaxed);
    assert!(matches!(relaxes, Err(Broken::Tier(_))), "{relaxes:?}");
}

#[test]
fn a_plan_that_withholds_a_home_or_a_reason_is_seen() {
    let withholds = verdict(|_, plan| {
        let placed = plan.placements.remove(1);
        plan.homeless[0].component = placed.component;
    });
    assert!(matches!(withholds, Err(Broken::NotOnce(_))), "{withholds:?}");

    let withholds = verdict(|_, plan| {
        let placed = plan.placements.remove(1);
        let mut homeless = plan.homeless[0].clone();
        homeless.component = placed.component;
        plan.homeless.insert(0, homeless);
    });
    assert!(matches!(withholds, Err(Broken::WouldFit { .. })), "{withholds:?}");

    let mute = verdict(|_, plan| plan.homeless[0].refusals.clear());
    assert!(matches!(mute, Err(Broken::NoReason { .. })), "{mute:?}");
}
