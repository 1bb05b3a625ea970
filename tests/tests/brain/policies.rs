//! Policies that cannot be read: refused from operators, replaced when others took them.

use std::{sync::Arc, time::Duration};

use sdr_core::{
    brain::{Brain, BrainConfig, Seams},
    effect::{Effect, StoredState},
    input::Input,
    mesh::{Fact, Facts},
    record::{FleetValue, RecordKind},
    report::HostReport,
    spec::PolicyBytes,
    time::Instant,
};
use sdr_tests::{fleet::Fleet, systems::single};

/// Written by a version that is still to come.
fn unreadable() -> PolicyBytes {
    PolicyBytes { name: "of-tomorrow".into(), bytes: vec![0xff, 1, 2, 3] }
}

/// What the agent fills in.
pub(super) fn seams() -> Seams {
    Seams {
        recovery: Box::new(sdr_recovery::make),
        allocation: Box::new(sdr_alloc::check),
        commons: None,
    }
}

#[test]
fn a_policy_that_cannot_be_read_is_refused_and_changes_nothing() {
    let mut fleet = Fleet::new(3, 1);
    fleet.run(Duration::from_secs(2));
    fleet.deploy(0, &single(100));
    fleet.run(Duration::from_secs(3));

    let mut recovery = single(100);
    recovery.recovery = unreadable();
    let mut allocation = single(100);
    allocation.allocation = unreadable();
    fleet.deploy(0, &recovery);
    fleet.deploy(0, &allocation);
    fleet.run(Duration::from_secs(3));

    let answers = fleet.answers_of(0);
    let [Ok(first), Err(of_recovery), Err(of_allocation)] = &answers[..] else {
        panic!("{answers:?}");
    };
    assert_eq!(first.revision, 1);
    assert!(of_recovery.contains("recovery policy `of-tomorrow`"), "{of_recovery}");
    assert!(of_allocation.contains("allocation policy `of-tomorrow`"), "{of_allocation}");
    let table = fleet.table(1).unwrap();
    let (version, _) = table.get(RecordKind::SYSTEM, single(100).name.as_str()).unwrap();
    assert_eq!(version.revision, 1);
    assert!(fleet.is_running(single(100).name.as_str()));
}

/// What a robot remembers of a system whose policies a later version wrote.
fn remembered() -> StoredState {
    let mut fleet = Fleet::new(1, 1);
    fleet.run(Duration::from_secs(3));
    fleet.deploy(0, &single(100));
    fleet.run(Duration::from_secs(3));
    let mut facts = Facts::default();
    for fact in fleet.table(0).unwrap().facts().iter() {
        let mut record = fact.record().clone();
        let policy = Arc::new(unreadable());
        match record.key.kind {
            RecordKind::RECOVERY => record.value = FleetValue::Recovery(policy).encode(),
            RecordKind::ALLOCATION => record.value = FleetValue::Allocation(policy).encode(),
            _ => {}
        }
        facts.put(Fact::read(record).unwrap());
    }
    StoredState { incarnation: 1, fleet: facts, ..StoredState::default() }
}

#[test]
fn a_system_whose_policies_another_version_wrote_runs_by_the_defaults() {
    let facts = Fleet::new(1, 1).robots[0].facts.clone();
    let config = BrainConfig::new("robot-1".parse().unwrap(), facts);
    let mut now = Instant::from_millis(1000);
    let mut brain = Brain::new(config, seams(), Some(remembered()), now);

    let (mut launched, mut told) = (0, Vec::new());
    for _ in 0..40 {
        now = now + Duration::from_millis(100);
        brain.handle(now, Input::Host(HostReport::default()));
        while let Some(effect) = brain.poll_effect() {
            match effect {
                Effect::Launch(_) => launched += 1,
                Effect::Store { ticket, .. } => brain.handle(now, Input::Stored { ticket }),
                Effect::Event(event) => told.push(event.kind),
                Effect::Send { .. }
                | Effect::Fetch { .. }
                | Effect::Command { .. }
                | Effect::Routes(_)
                | Effect::Plan { .. }
                | Effect::Ask(_)
                | Effect::Answer { .. } => {}
            }
        }
    }

    assert_eq!(launched, 1);
    assert_eq!(told.iter().filter(|kind| *kind == "policy-unreadable").count(), 1, "{told:?}");
}
