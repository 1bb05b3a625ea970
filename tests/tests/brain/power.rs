//! Power fails everywhere: each robot goes on from its own disk, alone.

use std::time::Duration;

use sdr_core::{spec::SystemSpec, units::Bytes};
use sdr_tests::{
    fleet::Fleet,
    systems::{component, connection, single},
};

const WORDS: [&str; 6] = ["fisheye", "anomaly", "camera", "controller", "position", "worker"];

/// A chain of six components that belong on robot-2.
fn chain(memory_mega: u64) -> SystemSpec {
    let mut system = single(memory_mega);
    system.components = WORDS.map(|word| component(word, memory_mega)).into();
    for component in &mut system.components {
        component.place.robot = Some("robot-2".parse().unwrap());
    }
    system.connections =
        WORDS.windows(2).map(|pair| connection((pair[0], "out"), (pair[1], "into"))).collect();
    system
}

#[test]
fn a_robot_that_lost_power_while_an_edition_arrived_runs_a_whole_one_alone() {
    for after_ms in (5..600).step_by(15) {
        let mut fleet = Fleet::with_memory(3, after_ms, Bytes::mega(4000));
        fleet.run(Duration::from_secs(3));
        fleet.deploy(0, &chain(100));
        let runs = |fleet: &Fleet| fleet.is_running("alone");
        fleet.run_until(Duration::from_secs(30), "runs", runs);
        fleet.run(Duration::from_secs(1));
        fleet.lose(600);

        fleet.deploy(0, &chain(90));
        fleet.run(Duration::from_millis(after_ms));
        (0..3).for_each(|robot| fleet.switch_off(robot));
        fleet.switch_on(1);
        fleet.run(Duration::from_secs(10));

        let idle: Vec<&str> =
            WORDS.into_iter().filter(|word| !fleet.robots[1].has_active(word)).collect();
        assert_eq!(idle, Vec::<&str>::new(), "off after {after_ms} ms\n{}", fleet.story());
    }
}
