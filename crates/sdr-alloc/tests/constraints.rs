//! Every constraint by itself: met, missed, unknown.

mod build;

use std::time::Duration;

use build::{
    first_fit, homes, item, name, offer, pair, problem, reasons, refusing, robot_id, settled,
    solve, wire,
};
use sdr_alloc::{Bars, BatteryBar, IfUnknown, Millimetres, Policy};
use sdr_core::{
    allocate::{Problem, RobotOffer},
    units::{Bytes, Dbm, Permille, Position},
};

/// What robot-1 alone says to one item.
fn why(bars: Bars, change: impl Fn(&mut RobotOffer)) -> Vec<String> {
    why_by(&first_fit(bars), change)
}

fn why_by(policy: &Policy, change: impl Fn(&mut RobotOffer)) -> Vec<String> {
    let mut robot = offer("robot-1");
    change(&mut robot);
    let plan = solve(&problem(policy, vec![robot], vec![item("camera")]));
    plan.homeless.first().map(reasons).unwrap_or_default()
}

/// What robot-1 says to a camera whose consumer stays on robot-2.
fn why_linked(policy: &Policy, change: impl Fn(&mut Problem)) -> Vec<String> {
    let mut problem =
        problem(policy, vec![offer("robot-1"), offer("robot-2")], vec![item("camera")]);
    problem.items[0].place.robot = Some(robot_id("robot-1"));
    problem.settled = vec![settled("position", "robot-2")];
    problem.connections = vec![wire("camera", "position")];
    problem.pairs = vec![pair("robot-1", "robot-2")];
    change(&mut problem);
    let plan = solve(&problem);
    let all = plan.homeless.first().map(reasons).unwrap_or_default();
    all.into_iter().filter(|reason| reason.starts_with("robot-1")).collect()
}

const NONE: [&str; 0] = [];

#[test]
fn memory_is_judged_after_placing_and_includes_the_bar() {
    let bars = || Bars { memory_free_at_least: Some(Bytes::mega(200)), ..Bars::none() };
    assert_eq!(why(bars(), |robot| robot.memory_free = Bytes::mega(730)), NONE);
    assert_eq!(
        why(bars(), |robot| robot.memory_free = Bytes::mega(729)),
        ["robot-1: memory_free 199 MB, bar 200 MB"]
    );
}

#[test]
fn memory_never_runs_out_even_without_a_bar() {
    assert_eq!(why(Bars::none(), |robot| robot.memory_free = Bytes::mega(530)), NONE);
    assert_eq!(
        why(Bars::none(), |robot| robot.memory_free = Bytes::mega(500)),
        ["robot-1: memory_free -30 MB, bar 0 MB"]
    );
}

#[test]
fn cpu_is_a_share_of_the_capacity_after_placing() {
    let bars = || Bars { cpu_used_at_most: Some(Permille(800)), ..Bars::none() };
    assert_eq!(why(bars(), |robot| robot.cpu_free = Permille(1000)), NONE);
    assert_eq!(
        why(bars(), |robot| robot.cpu_free = Permille(999)),
        ["robot-1: cpu_used 80.1 %, bar 80 %"]
    );
    let none = |robot: &mut RobotOffer| (robot.cpu_capacity, robot.cpu_free) = Default::default();
    assert_eq!(why(bars(), none).len(), 1);
}

#[test]
fn a_robot_without_a_gauge_is_refused_assumed_or_as_bad_as_the_worst() {
    let bars = Bars { battery_at_least: Some(BatteryBar::new(Permille(300))), ..Bars::none() };
    let mut policy = first_fit(bars);
    let unknown = |robot: &mut RobotOffer| robot.battery = None;

    assert_eq!(why_by(&policy, |robot| robot.battery = Some(Permille(300))), NONE);
    assert_eq!(
        why_by(&policy, |robot| robot.battery = Some(Permille(299))),
        ["robot-1: battery 29.9 %, bar 30 %"]
    );
    assert_eq!(why_by(&policy, unknown), ["robot-1: battery unknown, bar 30 %"]);

    policy.unknown.battery = IfUnknown::Assume(Permille(1000));
    assert_eq!(why_by(&policy, unknown), NONE);
    policy.unknown.battery = IfUnknown::Worst;
    assert_eq!(why_by(&policy, unknown), ["robot-1: battery unknown, bar 30 %"]);

    let mut robots = vec![offer("robot-1"), offer("robot-2")];
    (robots[0].battery, robots[1].battery) = (None, Some(Permille(290)));
    let plan = solve(&problem(&policy, robots, vec![item("camera")]));
    assert_eq!(reasons(&plan.homeless[0])[0], "robot-1: battery 29 %, bar 30 %");
}

#[test]
fn hungry_components_stay_off_tired_robots_and_others_may_go_there() {
    let bar = BatteryBar { at_least: Permille(500), if_needs_cpu: Some(Permille(500)) };
    let policy = first_fit(Bars { battery_at_least: Some(bar), ..Bars::none() });
    let mut robots = vec![offer("robot-1"), offer("robot-2")];
    robots[0].battery = Some(Permille(400));
    let mut items = vec![item("detector"), item("logger")];
    items[0].needs.cpu = Permille(500);

    let plan = solve(&problem(&policy, robots, items));

    assert_eq!(homes(&plan), ["detector: robot-2", "logger: robot-1"]);
}

#[test]
fn a_pair_has_the_worse_of_its_two_radio_levels() {
    let mut policy =
        first_fit(Bars { rssi_at_least: Some(Dbm::from_tenths(-750)), ..Bars::none() });
    let weak = |tenths| {
        move |problem: &mut Problem| {
            problem.robots[1].rssi = Some(Dbm::from_tenths(tenths));
        }
    };
    let unknown = |problem: &mut Problem| problem.robots[1].rssi = None;

    assert_eq!(why_linked(&policy, weak(-750)), NONE);
    assert_eq!(
        why_linked(&policy, weak(-751)),
        ["robot-1: rssi -75.1 dBm to robot-2, bar -75.0 dBm"]
    );
    assert_eq!(why_linked(&policy, unknown), ["robot-1: rssi unknown to robot-2, bar -75.0 dBm"]);
    policy.unknown.rssi = IfUnknown::Assume(Dbm::from_tenths(-600));
    assert_eq!(why_linked(&policy, unknown), NONE);
    policy.unknown.rssi = IfUnknown::Worst;
    assert_eq!(why_linked(&policy, unknown), NONE);
}

#[test]
fn jitter_delay_and_loss_of_the_pair_count_and_unknown_ones_are_refused() {
    let millis = Duration::from_millis;
    let policy = first_fit(Bars {
        jitter_at_most: Some(millis(50)),
        delay_at_most: Some(millis(100)),
        loss_at_most: Some(Permille(50)),
        ..Bars::none()
    });
    let set = |jitter, delay, loss| {
        move |problem: &mut Problem| {
            problem.pairs[0].jitter = jitter;
            problem.pairs[0].delay = delay;
            problem.pairs[0].loss = loss;
        }
    };

    let good = set(Some(millis(50)), Some(millis(100)), Some(Permille(50)));
    assert_eq!(why_linked(&policy, good), NONE);
    let bad = set(Some(Duration::from_micros(50_100)), Some(millis(101)), Some(Permille(51)));
    assert_eq!(
        why_linked(&policy, bad),
        [
            "robot-1: jitter 50.1 ms to robot-2, bar 50.0 ms",
            "robot-1: delay 101.0 ms to robot-2, bar 100.0 ms",
            "robot-1: loss 5.1 % to robot-2, bar 5 %"
        ]
    );
    assert_eq!(why_linked(&policy, set(None, None, None)).len(), 3);
    assert_eq!(why_linked(&policy, |problem| problem.pairs.clear()).len(), 3);
}

#[test]
fn distance_needs_both_positions() {
    let mut policy =
        first_fit(Bars { distance_at_most: Some(Millimetres(30_000)), ..Bars::none() });
    let at = |x_mm| {
        move |problem: &mut Problem| {
            problem.robots[1].position = Some(Position { x_mm, ..Position::default() });
        }
    };
    let unknown = |problem: &mut Problem| problem.robots[0].position = None;

    assert_eq!(why_linked(&policy, at(30_000)), NONE);
    assert_eq!(
        why_linked(&policy, at(31_000)),
        ["robot-1: distance 31.0 m to robot-2, bar 30.0 m"]
    );
    assert_eq!(why_linked(&policy, unknown), ["robot-1: distance unknown to robot-2, bar 30.0 m"]);
    policy.unknown.distance = IfUnknown::Assume(Millimetres(0));
    assert_eq!(why_linked(&policy, unknown), NONE);
}

#[test]
fn links_are_judged_only_where_a_connection_crosses_robots() {
    let policy = first_fit(Bars { jitter_at_most: Some(Duration::ZERO), ..Bars::none() });
    assert_eq!(why_linked(&policy, |problem| problem.connections.clear()), NONE);
    let beside = |problem: &mut Problem| problem.settled = vec![settled("position", "robot-1")];
    assert_eq!(why_linked(&policy, beside), NONE);
    let gone = |problem: &mut Problem| problem.settled = vec![settled("position", "robot-9")];
    assert_eq!(why_linked(&policy, gone), NONE);
}

#[test]
fn devices_labels_launch_kinds_and_pins_are_asked_for_all_at_once() {
    let mut item = item("controller");
    item.devices = vec![name("wheels")];
    item.place.labels = vec!["red".into(), "indoor".into()];
    item.place.robot = Some(robot_id("robot-2"));
    item.launch = 5;
    let mut robot = offer("robot-1");
    robot.labels = vec!["red".into()];

    let plan = solve(&problem(&refusing(), vec![robot], vec![item]));

    assert_eq!(
        reasons(&plan.homeless[0]),
        [
            "robot-1: place robot-1, bar robot-2",
            "robot-1: labels red, bar red, indoor",
            "robot-1: devices none, bar wheels",
            "robot-1: launch not installed, bar what launches controller"
        ]
    );
}

#[test]
fn a_copy_that_is_pinned_by_its_scope_goes_nowhere_else() {
    let mut copy = item("driver");
    copy.component.scope = Some(robot_id("robot-2"));
    let robots = vec![offer("robot-1"), offer("robot-2")];

    let plan = solve(&problem(&first_fit(Bars::none()), robots, vec![copy]));

    assert_eq!(homes(&plan), ["driver: robot-2"]);
}

#[test]
fn what_must_be_apart_is_apart_whichever_says_so() {
    let robots = || vec![offer("robot-1"), offer("robot-2")];
    for speaker in [0, 1] {
        let mut items = vec![item("left"), item("right")];
        let other = items[1 - speaker].component.name.clone();
        items[speaker].place.apart_from = vec![other];
        let plan = solve(&problem(&first_fit(Bars::none()), robots(), items));
        assert_eq!(homes(&plan), ["left: robot-1", "right: robot-2"]);
    }

    let mut problem = problem(&first_fit(Bars::none()), robots(), vec![item("left")]);
    problem.items[0].place.apart_from = vec![name("right")];
    problem.settled = vec![settled("right", "robot-1")];
    let plan = solve(&problem);
    assert_eq!(homes(&plan), ["left: robot-2"]);
    assert_eq!(
        plan.placements[0].refusals[0].to_string(),
        "robot-1: apart_from right here, bar no right"
    );
}

#[test]
fn what_must_be_together_goes_where_all_of_it_fits() {
    let mut robots = vec![offer("robot-1"), offer("robot-2")];
    robots[0].memory_free = Bytes::mega(1000);
    let mut items = vec![item("left"), item("between"), item("right")];
    items[2].place.together_with = vec![name("left")];

    let plan = solve(&problem(&first_fit(Bars::none()), robots, items));

    assert_eq!(homes(&plan), ["left: robot-2", "between: robot-1", "right: robot-2"]);
    assert_eq!(
        plan.placements[0].refusals[0].to_string(),
        "robot-1: memory_free -60 MB with right, bar 0 MB"
    );
}

#[test]
fn what_cannot_be_together_leaves_one_homeless_with_that_reason() {
    let mut robots = vec![offer("robot-1"), offer("robot-2")];
    (robots[0].memory_free, robots[1].memory_free) = (Bytes::mega(600), Bytes::mega(600));
    let mut items = vec![item("left"), item("right")];
    items[1].place.together_with = vec![name("left")];

    let plan = solve(&problem(&first_fit(Bars::none()), robots, items));

    assert_eq!(homes(&plan), ["left: robot-1"]);
    assert_eq!(
        reasons(&plan.homeless[0]),
        [
            "robot-1: memory_free -460 MB, bar 0 MB",
            "robot-2: together_with left on robot-1, bar left here"
        ]
    );
}

#[test]
fn needs_that_nobody_knows_are_those_of_the_policy() {
    let policy = first_fit(Bars::none());
    let mut items = vec![item("camera")];
    items[0].needs = Default::default();

    let plan = solve(&problem(&policy, vec![offer("robot-1")], items));

    assert_eq!(plan.placements[0].memory_left, Bytes::mega(1800));
}

#[test]
fn largest_first_is_tried_when_the_order_of_the_file_leaves_one_homeless() {
    let mut robots = vec![offer("robot-1"), offer("robot-2")];
    (robots[0].memory_free, robots[1].memory_free) = (Bytes::mega(900), Bytes::mega(600));
    let mut items = vec![item("small"), item("large")];
    items[0].needs.memory = Bytes::mega(300);
    items[1].needs.memory = Bytes::mega(700);

    let plan = solve(&problem(&first_fit(Bars::none()), robots, items));

    assert_eq!(homes(&plan), ["small: robot-2", "large: robot-1"]);
}
