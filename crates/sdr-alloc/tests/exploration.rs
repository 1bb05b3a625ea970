//! The paper's Section III in numbers: Table V, Fig. 3 (1) and Fig. 3 (2).

mod build;

use build::{exploration, homes, item, offer, problem, reasons, robot_id, settled, solve, wire};
use sdr_core::{
    allocate::{Problem, Tier},
    units::Bytes,
};

fn deployment() -> Problem {
    let robots = ["robot-1", "robot-2", "robot-3"].map(offer).to_vec();
    let items = ["fisheye", "anomaly", "camera", "controller", "position"].map(item).to_vec();
    Problem { connections: wires(), ..problem(&exploration(), robots, items) }
}

fn wires() -> Vec<sdr_core::allocate::Wire> {
    vec![
        wire("fisheye", "anomaly"),
        wire("anomaly", "controller"),
        wire("camera", "position"),
        wire("position", "controller"),
        wire("controller", "position"),
    ]
}

/// Robot-1 fades: its two components must leave, the three others stay.
fn recovery() -> Problem {
    let mut robots = ["robot-1", "robot-2", "robot-3"].map(offer).to_vec();
    robots[1].memory_free = Bytes::mega(840);
    robots[2].memory_free = Bytes::mega(1370);
    let mut items = ["fisheye", "anomaly"].map(item).to_vec();
    for item in &mut items {
        item.running_on = vec![robot_id("robot-1")];
        item.avoid = vec![(robot_id("robot-1"), "left for rssi-low 0 s ago".into())];
    }
    Problem {
        tier: Tier::Relaxed,
        settled: vec![
            settled("camera", "robot-2"),
            settled("controller", "robot-2"),
            settled("position", "robot-3"),
        ],
        connections: wires(),
        ..problem(&exploration(), robots, items)
    }
}

#[test]
fn the_receiver_takes_two_the_next_two_and_the_last_one() {
    let plan = solve(&deployment());

    assert_eq!(
        homes(&plan),
        [
            "fisheye: robot-1",
            "anomaly: robot-1",
            "camera: robot-2",
            "controller: robot-2",
            "position: robot-3"
        ]
    );
    let left: Vec<u64> = plan.placements.iter().map(|p| p.memory_left.0 / 1_000_000).collect();
    assert_eq!(left, [1370, 840, 1370, 840, 1370]);
    assert!(plan.placements[0].refusals.is_empty());
    let why: Vec<String> = plan.placements[4].refusals.iter().map(ToString::to_string).collect();
    assert_eq!(
        why,
        ["robot-1: memory_free 310 MB, bar 500 MB", "robot-2: memory_free 310 MB, bar 500 MB"]
    );
    assert_eq!(
        sdr_alloc::placement_line(&plan.placements[2]),
        "exploration/camera to robot-2, 1370 MB left; robot-1: memory_free 310 MB, bar 500 MB"
    );
}

#[test]
fn the_list_begins_with_whoever_received_the_file() {
    let plan = solve(&Problem { receiver: robot_id("robot-3"), ..deployment() });

    let robots: Vec<&str> = plan.placements.iter().map(|p| p.robot.as_str()).collect();
    assert_eq!(robots, ["robot-3", "robot-3", "robot-1", "robot-1", "robot-2"]);
}

#[test]
fn both_leave_for_the_robot_that_holds_both_under_relaxed_bars() {
    let plan = solve(&recovery());

    assert_eq!(homes(&plan), ["fisheye: robot-3", "anomaly: robot-3"]);
    assert!(plan.placements.iter().all(|placement| placement.tier == Tier::Relaxed));
    assert_eq!(plan.placements[1].memory_left, Bytes::mega(310));
    let why: Vec<String> = plan.placements[0].refusals.iter().map(ToString::to_string).collect();
    assert_eq!(
        why,
        [
            "robot-1: avoid left for rssi-low 0 s ago, bar a robot without that",
            "robot-2: memory_free -220 MB with anomaly, bar 250 MB"
        ]
    );
}

#[test]
fn strict_bars_have_no_answer_to_the_same_question() {
    let plan = solve(&Problem { tier: Tier::Strict, ..recovery() });

    assert_eq!(plan.placements.len(), 1);
    assert_eq!(
        reasons(&plan.homeless[0]),
        [
            "robot-1: avoid left for rssi-low 0 s ago, bar a robot without that",
            "robot-2: memory_free 310 MB, bar 500 MB",
            "robot-3: memory_free 310 MB, bar 500 MB"
        ]
    );
}

#[test]
fn strict_bars_are_kept_when_they_can_be_kept() {
    let mut roomy = recovery();
    roomy.robots[2].memory_free = Bytes::mega(1560);

    let plan = solve(&roomy);

    assert_eq!(homes(&plan), ["fisheye: robot-3", "anomaly: robot-3"]);
    assert!(plan.placements.iter().all(|placement| placement.tier == Tier::Strict));
    assert_eq!(plan.placements[1].memory_left, Bytes::mega(500));
}

#[test]
fn a_group_that_fits_nowhere_whole_is_spread_and_one_too_many_stays_homeless() {
    let mut tight = recovery();
    tight.robots[2].memory_free = Bytes::mega(900);
    assert_eq!(homes(&solve(&tight)), ["fisheye: robot-2", "anomaly: robot-3"]);

    tight.robots[2].memory_free = Bytes::mega(700);
    let plan = solve(&tight);
    assert_eq!(homes(&plan), ["fisheye: robot-2"]);
    assert_eq!(
        sdr_alloc::homeless_line(&plan.homeless[0]),
        "exploration/anomaly has no home; robot-1: avoid left for rssi-low 0 s ago, bar a robot \
         without that; robot-2: memory_free -220 MB, bar 250 MB; robot-3: memory_free 170 MB, bar 250 MB"
    );
}
