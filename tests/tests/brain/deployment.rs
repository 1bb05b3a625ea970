//! From a deployment to processes, each where it belongs, once.

use std::time::Duration;

use sdr_core::lifecycle::LifecycleState;
use sdr_tests::{
    fleet::Fleet,
    systems::{component, exploration, single},
};

const LONG: Duration = Duration::from_secs(20);

fn homes(fleet: &Fleet) -> Vec<String> {
    let words = ["fisheye", "anomaly", "camera", "controller", "position"];
    words.iter().map(|word| fleet.home("exploration", word).unwrap_or_default()).collect()
}

fn deployed(seed: u64) -> Fleet {
    let mut fleet = Fleet::new(3, seed);
    fleet.run(Duration::from_secs(2));
    fleet.deploy(0, &exploration());
    fleet.run_until(LONG, "all active", |fleet| fleet.is_running("exploration"));
    fleet
}

#[test]
fn the_papers_system_spreads_over_three_robots_as_in_figure_3() {
    let fleet = deployed(1);

    assert_eq!(homes(&fleet), ["robot-1", "robot-1", "robot-2", "robot-2", "robot-3"]);
    assert!(matches!(&fleet.answers_of(0)[..], [Ok(answer)] if answer.revision == 1));
    for component in &fleet.status().systems[0].components {
        assert_eq!((component.epoch, component.state), (1, Some(LifecycleState::Active)));
    }
    let launches: usize = fleet.robots.iter().map(|robot| robot.launches).sum();
    assert_eq!(launches, 5, "{}", fleet.story());
}

#[test]
fn reasons_name_the_robot_the_number_and_the_bar() {
    let fleet = deployed(1);

    let position = fleet.component("exploration", "position").unwrap();
    assert!(
        position.reason.contains("robot-1: memory_free 310 MB, bar 500 MB"),
        "{}",
        position.reason
    );
    assert!(position.reason.contains("robot-2"), "{}", position.reason);
}

#[test]
fn any_robot_takes_the_file_and_is_filled_first() {
    let mut fleet = Fleet::new(3, 2);
    fleet.run(Duration::from_secs(2));
    fleet.deploy(2, &exploration());
    fleet.run_until(LONG, "all active", |fleet| fleet.is_running("exploration"));

    assert_eq!(homes(&fleet), ["robot-3", "robot-3", "robot-1", "robot-1", "robot-2"]);
}

#[test]
fn a_deployment_survives_heavy_loss_and_starts_nothing_twice() {
    let mut fleet = Fleet::new(3, 3);
    fleet.lose(300);
    fleet.run(Duration::from_secs(3));
    fleet.deploy(1, &exploration());
    fleet.run_until(LONG, "all active", |fleet| fleet.is_running("exploration"));
    fleet.run(Duration::from_secs(10));

    let launches: usize = fleet.robots.iter().map(|robot| robot.launches).sum();
    assert_eq!(launches, 5, "{}", fleet.story());
}

#[test]
fn deploying_the_same_again_changes_nothing() {
    let mut fleet = deployed(4);
    fleet.deploy(1, &exploration());
    fleet.run(Duration::from_secs(3));

    assert!(matches!(&fleet.answers_of(1)[..], [Ok(answer)] if !answer.changed));
    let launches: usize = fleet.robots.iter().map(|robot| robot.launches).sum();
    assert_eq!(launches, 5);
}

#[test]
fn a_new_revision_touches_only_what_changed() {
    let mut fleet = deployed(5);
    let mut changed = exploration();
    changed.components[2].parameters.push(("fps".into(), sdr_core::spec::Value::Int(5)));
    fleet.deploy(0, &changed);
    fleet.run(Duration::from_secs(3));

    assert!(fleet.is_running("exploration"), "{}", fleet.story());
    let launches: usize = fleet.robots.iter().map(|robot| robot.launches).sum();
    assert_eq!(launches, 6, "{}", fleet.story());
}

#[test]
fn undeploy_ends_everything_and_the_next_deployment_goes_on_counting() {
    let mut fleet = deployed(6);
    fleet.undeploy(2, "exploration");
    fleet.run(Duration::from_secs(2));
    assert!(fleet.status().systems.is_empty());
    assert!(fleet.active_on("fisheye").is_empty());

    fleet.deploy(0, &exploration());
    fleet.run_until(LONG, "active again", |fleet| fleet.is_running("exploration"));
    assert_eq!(fleet.component("exploration", "fisheye").unwrap().epoch, 2, "a new choice");
    let run = fleet.component("exploration", "fisheye").unwrap().run;
    assert!(run > 1, "a run is never used twice");
}

#[test]
fn what_fits_nowhere_is_refused_by_robot_number_and_bar_and_placed_once_it_fits() {
    let mut fleet = Fleet::new(2, 7);
    fleet.run(Duration::from_secs(2));
    fleet.deploy(0, &single(5000));
    fleet.run(Duration::from_secs(2));

    let worker = fleet.component("alone", "worker").unwrap();
    let coordinator = fleet.robots.iter().find(|robot| robot.is_coordinator()).unwrap();
    let status = coordinator.status(fleet.now).unwrap();
    let refusals = &status.systems[0].components[0].refusals;
    assert_eq!((worker.home, refusals.len()), (None, 2), "{}", fleet.story());
    assert!(refusals.iter().all(|refusal| refusal.constraint == "memory_free"));
}

#[test]
fn a_component_waits_for_those_before_it() {
    let mut fleet = Fleet::new(1, 8);
    fleet.run(Duration::from_secs(3));
    let mut system = single(100);
    let mut second = component("camera", 100);
    second.after = vec![system.components[0].name.clone()];
    system.components.insert(0, second);
    fleet.deploy(0, &system);
    fleet.run_until(LONG, "all active", |fleet| fleet.is_running("alone"));

    let order: Vec<String> = fleet
        .events("active")
        .iter()
        .map(|(_, event)| event.component.as_ref().unwrap().to_string())
        .collect();
    assert_eq!(order, ["worker", "camera"]);
}

#[test]
fn a_robot_that_cannot_store_refuses_and_says_so() {
    let mut fleet = Fleet::new(1, 9);
    fleet.run(Duration::from_secs(3));
    fleet.robots[0].fill_disk(true);
    fleet.deploy(0, &single(100));
    fleet.run(Duration::from_secs(2));
    assert!(fleet.answers_of(0)[0].as_ref().unwrap_err().contains("no space left"));
    assert!(!fleet.events("minting-paused").is_empty());

    fleet.robots[0].fill_disk(false);
    fleet.run(Duration::from_secs(3));
    fleet.deploy(0, &single(100));
    fleet.run_until(LONG, "active", |fleet| fleet.is_running("alone"));
}

#[test]
fn the_same_seed_tells_the_same_story() {
    assert_eq!(deployed(10).story(), deployed(10).story());
}
