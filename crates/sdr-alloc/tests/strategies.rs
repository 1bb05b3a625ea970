//! What differs between the strategies: order, standbys, score.

mod build;

use build::{first_fit, homes, item, offer, problem, robot_id, settled, solve, wire};
use sdr_alloc::{Bars, Policy, StartWith, Weight, Weights, allocate};
use sdr_core::{
    allocate::{AllocError, Problem, RobotOffer},
    spec::PolicyBytes,
    units::{Bytes, Dbm, Permille, Position},
};

fn three() -> Vec<RobotOffer> {
    ["robot-1", "robot-2", "robot-3"].map(offer).to_vec()
}

/// Best-score that weighs one thing only.
fn only(change: impl Fn(&mut Weights)) -> Policy {
    let zero = Weight(0);
    let mut weights = Weights {
        memory_left: zero,
        cpu_left: zero,
        battery: zero,
        link_quality: zero,
        nearness: zero,
        stay: zero,
    };
    change(&mut weights);
    Policy { strict: Bars::none(), weights, ..Policy::default() }
}

#[test]
fn first_fit_follows_its_list_then_the_names() {
    let start_with = StartWith::List(vec![robot_id("robot-3"), robot_id("robot-9")]);
    let policy = Policy { start_with, ..first_fit(Bars::none()) };
    let items = ["a", "b", "c", "d", "e", "f", "g"].map(item).to_vec();

    let plan = solve(&problem(&policy, three(), items));

    let robots: Vec<&str> = plan.placements.iter().map(|p| &p.robot.as_str()[6..]).collect();
    assert_eq!(robots, ["3", "3", "3", "1", "1", "1", "2"]);
}

#[test]
fn first_fit_may_ask_the_nearest_first() {
    let policy = Policy { start_with: StartWith::Nearest, ..first_fit(Bars::none()) };
    let mut robots = three();
    robots[1].position = Some(Position { x_mm: 9_000, ..Position::default() });
    robots[2].position = Some(Position { x_mm: 4_000, ..Position::default() });
    let items = ["a", "b", "c", "d"].map(item).to_vec();

    let plan = solve(&problem(&policy, robots, items));

    assert_eq!(homes(&plan)[3], "d: robot-3");
}

#[test]
fn a_standby_that_runs_already_is_taken_before_anything_is_started() {
    for policy in [first_fit(Bars::none()), Policy::default()] {
        let mut problem = problem(&policy, three(), vec![item("camera")]);
        problem.robots[1].memory_free = Bytes::mega(800);
        problem.items[0].running_on = vec![robot_id("robot-2")];
        assert_eq!(homes(&solve(&problem)), ["camera: robot-2"]);

        problem.robots[1].memory_free = Bytes::mega(300);
        assert_ne!(homes(&solve(&problem)), ["camera: robot-2"]);
    }
}

#[test]
fn best_score_takes_the_robot_with_most_left_and_says_by_how_much() {
    let mut robots = three();
    robots[1].memory_free = Bytes::mega(2500);

    let plan = solve(&problem(&only(|w| w.memory_left = Weight(1000)), robots, vec![item("a")]));

    assert_eq!(homes(&plan), ["a: robot-2"]);
    assert_eq!(
        plan.placements[0].refusals[0].to_string(),
        "robot-1: score 0.548, bar 0.788 on robot-2"
    );
}

#[test]
fn each_term_of_the_score_pulls_its_way() {
    let pulls: [(&str, Policy); 4] = [
        ("cpu", only(|w| w.cpu_left = Weight(1000))),
        ("battery", only(|w| w.battery = Weight(1000))),
        ("link", only(|w| w.link_quality = Weight(1000))),
        ("near", only(|w| w.nearness = Weight(1000))),
    ];
    for (what, policy) in pulls {
        let mut robots = three();
        for robot in &mut robots[..2] {
            match what {
                "cpu" => robot.cpu_free = Permille(1000),
                "battery" => robot.battery = Some(Permille(400)),
                "link" => robot.rssi = Some(Dbm::from_tenths(-700)),
                _ => robot.position = Some(Position { y_mm: 20_000, ..Position::default() }),
            }
        }
        let mut problem = problem(&policy, robots, vec![item("a"), item("b")]);
        problem.receiver = robot_id("robot-3");
        problem.connections = vec![wire("a", "b")];
        assert_eq!(homes(&solve(&problem))[0], "a: robot-3", "{what}");
    }
}

#[test]
fn talking_to_a_neighbour_pulls_to_its_robot() {
    let policy = only(|w| w.link_quality = Weight(1000));
    let mut problem = problem(&policy, three(), vec![item("a")]);
    problem.settled = vec![settled("b", "robot-3")];
    problem.connections = vec![wire("b", "a")];

    assert_eq!(homes(&solve(&problem)), ["a: robot-3"]);
}

#[test]
fn what_runs_somewhere_stays_there_when_staying_weighs_enough() {
    let policy = Policy { reuse_standbys: false, strict: Bars::none(), ..Policy::default() };
    let mut problem = problem(&policy, three(), vec![item("a")]);
    problem.items[0].running_on = vec![robot_id("robot-3")];
    problem.robots[2].memory_free = Bytes::mega(1000);

    assert_eq!(homes(&solve(&problem)), ["a: robot-3"]);
}

#[test]
fn equal_scores_go_to_the_first_by_name() {
    let plan = solve(&problem(&only(|_| {}), three(), vec![item("a")]));
    assert_eq!(homes(&plan), ["a: robot-1"]);
    let why = plan.placements[0].refusals[0].to_string();
    assert!(why.starts_with("robot-2: score "), "{why}");
    assert!(why.ends_with(": robot-1 has as much and is asked first"), "{why}");
}

#[test]
fn nobody_on_offer_leaves_all_homeless_and_an_unreadable_policy_is_named() {
    let empty = problem(&first_fit(Bars::none()), vec![], vec![item("a")]);
    assert_eq!(solve(&empty).homeless.len(), 1);

    let policy = PolicyBytes { name: "mine".into(), bytes: vec![200] };
    let error = allocate(&Problem { policy, ..empty }).unwrap_err();
    assert_eq!(error, AllocError::Policy("mine".into()));
    assert_eq!(error.to_string(), "allocation policy `mine` cannot be read");
}

#[test]
fn empty_policy_bytes_mean_the_default_policy() {
    let mut problem = problem(&Policy::default(), three(), vec![item("a")]);
    let by_default = solve(&problem);
    problem.policy = PolicyBytes::default();
    assert_eq!(solve(&problem), by_default);
    assert_eq!(by_default.allocator, "best-score");
}
