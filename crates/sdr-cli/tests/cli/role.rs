//! `sdr role`: who coordinates, why, by hand and by policy.

use std::fs;

use serde_json::{Value, json};

use crate::{
    agent::Agent,
    asking::status,
    sdr::{Run, sdr},
};

/// A fleet in which this robot holds the role.
fn held(holder: Option<&str>, term: u64) -> Value {
    let mut view = status("active", true);
    let candidate = |robot: &str, links: u64, unfit: Value| {
        json!({
            "robot": robot, "points": links, "unfit": unfit, "preferred": false,
            "parts": [{ "aspect": "links", "score": links, "weight": 4 }]
        })
    };
    view["role"] = json!({
        "holder": holder, "term": term, "by_operator": false, "suspended": false,
        "successors": ["robot-2"], "offered_to": null, "reason": "", "policy": "default",
        "candidates": [
            candidate("robot-1", 900, Value::Null),
            candidate("robot-2", 300, json!("battery 12.3 %, bar 20.0 %")),
        ]
    });
    view
}

fn ask(agent: &Agent, arguments: &[&str]) -> Run {
    sdr(&[arguments, &["--agent", &agent.socket()]].concat())
}

#[test]
fn the_holder_its_successors_and_all_candidates_are_shown() {
    let taken = json!([{
        "sequence": 1, "wall_ms": 3000, "monotonic_ns": 1, "kind": "role-taken",
        "robot": "robot-1", "reason": "term 2, fittest of 2", "numbers": { "term": 2.0 }
    }]);
    let agent = Agent::new().on("GET /v1/status", 200, &held(Some("robot-1"), 2)).on(
        "GET /v1/events",
        200,
        &taken,
    );
    for arguments in [&["role"][..], &["role", "show"]] {
        let run = ask(&agent, arguments);
        assert_eq!((run.code, run.stderr.as_str()), (Some(0), ""));
        let head = "robot-1 coordinates, term 2, since 00:00:03.000 (fittest of 2)";
        assert!(run.stdout.starts_with(head), "{}", run.stdout);
        assert!(run.stdout.contains("successors: robot-2\n"), "{}", run.stdout);
        assert!(run.stdout.lines().all(|line| line.chars().count() <= 80), "{}", run.stdout);
    }

    let run = ask(&agent, &["role", "-o", "json"]);
    let value = run.json();
    assert_eq!((&value["holder"], &value["term"]), (&json!("robot-1"), &json!(2)));
    assert_eq!(value["seen_from"], "robot-1");
    assert_eq!(value["taken"], json!({ "wall_ms": 3000, "reason": "term 2, fittest of 2" }));
    assert_eq!(value["rules"]["margin"], 150);
}

#[test]
fn a_fleet_that_nobody_coordinates_ends_with_one() {
    let agent = Agent::new().on("GET /v1/status", 200, &held(None, 0));
    let run = ask(&agent, &["role"]);
    assert_eq!(run.code, Some(1));
    assert!(run.stdout.starts_with("! nobody is known to hold the role"), "{}", run.stdout);
    assert_eq!(ask(&agent, &["role", "why", "-o", "json"]).json()["holder"], Value::Null);
}

#[test]
fn why_says_each_sum_and_the_bar_that_was_missed() {
    let agent = Agent::new().on("GET /v1/status", 200, &held(Some("robot-1"), 2));
    let run = ask(&agent, &["role", "why"]);
    assert_eq!(run.code, Some(0), "{}", run.stderr);
    for part in ["1. robot-1: 900 of 1000 points, coordinator", "links 900 x 4 = 3600, by 4"] {
        assert!(run.stdout.contains(part), "{part}\n{}", run.stdout);
    }
    let run = ask(&agent, &["role", "why", "-o", "json"]);
    let why: Vec<String> = serde_json::from_value(run.json()["why"].clone()).unwrap();
    assert!(why.contains(&"unfit: battery 12.3 %, bar 20.0 %".to_owned()), "{why:?}");
}

#[test]
fn a_move_is_awaited_until_the_asked_agent_sees_the_new_holder() {
    let answer = json!({ "holder": "robot-2", "term": 3, "changed": true });
    let agent = Agent::new()
        .on("POST /v1/role/move", 200, &answer)
        .on("GET /v1/status", 200, &held(Some("robot-1"), 2))
        .on("GET /v1/status", 200, &held(Some("robot-2"), 3));
    let run = ask(&agent, &["role", "move", "robot-2", "--wait"]);
    assert_eq!((run.code, run.stderr.as_str()), (Some(0), ""));
    assert!(run.stdout.contains("robot-1 holds it, term 2"), "{}", run.stdout);
    assert!(run.stdout.ends_with("robot-2 holds the role, term 3\n"), "{}", run.stdout);
    assert!(agent.asked()[0].ends_with(r#"{"to":"robot-2"}"#), "{:?}", agent.asked());

    let run = ask(&agent, &["role", "move", "robot-2", "-o", "json"]);
    let report = json!({ "holder": "robot-2", "term": 3, "changed": true, "done": null });
    assert_eq!((run.code, run.json()), (Some(0), report));
}

#[test]
fn a_move_that_is_not_seen_in_time_ends_with_one() {
    let answer = json!({ "holder": "robot-2", "term": 3, "changed": true });
    let agent = Agent::new().on("POST /v1/role/move", 200, &answer).on(
        "GET /v1/status",
        200,
        &held(Some("robot-1"), 4),
    );
    let arguments = ["role", "move", "robot-2", "--wait", "--timeout", "1ms", "-o", "json"];
    let run = ask(&agent, &arguments);
    assert_eq!((run.code, &run.json()["done"]), (Some(1), &json!(false)));
    let told = "sdr: robot-2 does not hold the role after 0.001 s\n robot-1 holds it, term 4\n";
    assert!(run.stderr.ends_with(told), "{}", run.stderr);
}

#[test]
fn a_robot_that_cannot_hold_it_is_refused_in_the_agents_words() {
    let refusal = json!({ "error": "robot-9 is not alive here; alive: [robot-1, robot-2]" });
    let agent = Agent::new().on("POST /v1/role/move", 409, &refusal);
    let run = ask(&agent, &["role", "move", "robot-9", "--wait"]);
    assert_eq!(run.code, Some(1));
    assert_eq!(run.stderr, "sdr: robot-9 is not alive here; alive: [robot-1, robot-2]\n");
    assert_eq!(ask(&agent, &["role", "move", "Robot 9"]).code, Some(2));
}

#[test]
fn a_policy_is_checked_set_and_shown_as_a_file_that_can_be_set_again() {
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("role.yaml");
    let path = file.to_str().unwrap();
    let answer = json!({ "holder": "robot-1", "term": 2, "changed": true });
    let agent = Agent::new().on("POST /v1/role/policy", 200, &answer);

    fs::write(&file, "role: tired\nextends: default\nmargn: 200\n").unwrap();
    let run = ask(&agent, &["role", "policy", path]);
    assert_eq!(run.code, Some(1));
    assert!(run.stderr.contains("role.yaml:3:1: unknown key `margn`"), "{}", run.stderr);
    assert!(run.stderr.ends_with("sdr: 1 problem; nothing was changed\n"), "{}", run.stderr);
    assert_eq!(agent.asked().len(), 0);

    fs::write(&file, "role: tired\nextends: default\nmargin: 200\n").unwrap();
    let run = ask(&agent, &["role", "policy", path, "-o", "json"]);
    assert_eq!(run.code, Some(0), "{}", run.stderr);
    assert_eq!(
        (&run.json()["changed"], &run.json()["policy"]["margin"]),
        (&json!(true), &json!(200))
    );
    let (_, body) =
        agent.asked()[0].split_once("\n\n").map(|(a, b)| (a.to_owned(), b.to_owned())).unwrap();
    let sent: Value = serde_json::from_str(&body).unwrap();

    let mut view = held(Some("robot-1"), 2);
    view["role"]["rules"] = sent["policy"].clone();
    let agent = agent.on("GET /v1/status", 200, &view);
    let shown = ask(&agent, &["role", "policy"]);
    assert_eq!(shown.code, Some(0), "{}", shown.stderr);
    fs::write(&file, &shown.stdout).unwrap();
    let run = sdr(&["validate", path, "-o", "json"]);
    assert_eq!((run.code, &run.json()[0]["kind"]), (Some(0), &json!("role")));
    assert_eq!(ask(&agent, &["role", "policy", path]).code, Some(0));
    assert_eq!(agent.asked()[2].split_once("\n\n").unwrap().1, body);
}
