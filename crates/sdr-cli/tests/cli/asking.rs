//! Commands that only ask.

use std::io::{BufRead, BufReader, Read};
use std::process::Stdio;

use serde_json::{Value, json};

use crate::{
    agent::Agent,
    sdr::{command, sdr},
};

/// A fleet of one with one component in this state.
pub(crate) fn status(state: &str, heard: bool) -> Value {
    json!({
        "seen_from": "robot-1", "coordinator": "robot-1", "term": 1,
        "robots": [{
            "name": "robot-1", "alive": true, "seen_ms": 0, "coordinator": true,
            "cpu_permille": 10, "memory_free_bytes": 840_000_000_u64,
            "memory_capacity_bytes": 1_900_000_000_u64, "battery_permille": null,
            "rssi_dbm": -47.1, "rtt_ms": null, "api": "/tmp/none.sock", "conditions": []
        }],
        "systems": [{
            "name": "moon", "revision": 1,
            "components": [{
                "name": "camera", "home": "robot-1", "state": state, "epoch": 1,
                "epoch_minted_by": "robot-1", "run": 1, "restarts": 0, "memory_bytes": 1,
                "cpu_permille": 1, "standbys": [], "reason": "first that fits"
            }],
            "connections": [{ "name": "camera.a -> camera.b", "heard": heard, "remote": false }]
        }],
        "conditions": []
    })
}

fn event(sequence: u64) -> Value {
    json!({
        "sequence": sequence, "wall_ms": 1000 * sequence, "monotonic_ns": 1, "kind": "placed",
        "robot": "robot-1", "system": "moon", "component": "camera", "reason": "first that fits"
    })
}

#[test]
fn a_fleet_that_is_well_ends_with_zero_and_one_that_is_not_with_one() {
    let well = Agent::new().on("GET /v1/status", 200, &status("active", true));
    let run = sdr(&["status", "--agent", &well.socket()]);
    assert_eq!((run.code, run.stderr.as_str()), (Some(0), ""));
    assert!(run.stdout.starts_with("1 robot, 1 system"), "{}", run.stdout);
    assert!(run.stdout.lines().all(|line| line.chars().count() <= 80));

    let mut failed = event(1);
    failed["kind"] = json!("error");
    failed["reason"] = json!("error: no lens");
    let ill = Agent::new().on("GET /v1/status", 200, &status("error", true)).on(
        "GET /v1/events",
        200,
        &json!([failed, event(2)]),
    );
    let run = sdr(&["status", "--agent", &ill.socket()]);
    assert_eq!(run.code, Some(1));
    let golden = "! camera is in error on robot-1 (first that fits)\n    last: error: no lens\n\n";
    assert!(run.stdout.starts_with(golden), "{}", run.stdout);
}

#[test]
fn json_is_the_agents_view_and_what_is_wrong_in_it() {
    let agent = Agent::new().on("GET /v1/status", 200, &status("error", true));
    let run = sdr(&["-o", "json", "status", "--agent", &agent.socket()]);
    let value = run.json();
    assert_eq!(run.code, Some(1));
    assert_eq!(value["robots"][0]["alive"], true);
    assert_eq!(value["systems"][0]["components"][0]["epoch"], 1);
    assert_eq!(value["problems"].as_array().unwrap().len(), 1);
}

#[test]
fn without_an_agent_the_next_step_is_named() {
    let run = sdr(&["status", "--agent", "/nowhere/agent.sock"]);
    assert_eq!(run.code, Some(1));
    assert_eq!(run.stdout, "");
    assert!(run.stderr.starts_with("sdr: no agent at /nowhere/agent.sock"), "{}", run.stderr);
    assert!(run.stderr.contains("Start it:"), "{}", run.stderr);

    let run = sdr(&["status", "-o", "json", "--agent", "/nowhere/agent.sock"]);
    assert!(run.json()["error"].as_str().unwrap().starts_with("no agent at"));
}

#[test]
fn wrong_usage_ends_with_two() {
    for arguments in [
        &["--nonsense"][..],
        &["deploy"],
        &["status", "--agent", "robot-2:7601"],
        &["undeploy", "No-Name"],
        &["logs", "../etc/passwd"],
        &["deploy", "x.yaml", "--timeout", "60"],
        &["-o", "xml", "status"],
    ] {
        let run = sdr(arguments);
        assert_eq!(run.code, Some(2), "{arguments:?}: {}", run.stderr);
        assert_ne!(run.stderr, "");
    }
}

#[test]
fn garbage_from_an_agent_is_a_sentence() {
    let agent = Agent::new().on_text("GET /v1/status", 200, "\u{1b}[2J<html>");
    let run = sdr(&["status", "--agent", &agent.socket()]);
    assert_eq!(run.code, Some(1));
    assert!(run.stderr.contains("cannot be read"), "{}", run.stderr);
    assert!(!run.stderr.contains('\u{1b}') && !run.stderr.contains("panicked"), "{}", run.stderr);
}

#[test]
fn the_last_events_are_shown_and_json_is_one_list() {
    let agent = Agent::new().on("GET /v1/events", 200, &json!([event(1), event(2), event(3)]));
    let run = sdr(&["events", "-n", "2", "--agent", &agent.socket()]);
    assert_eq!(run.code, Some(0));
    assert_eq!(run.stdout.lines().count(), 2);
    assert!(run.stdout.starts_with("00:00:02.000  robot-1"), "{}", run.stdout);

    let run = sdr(&["events", "-o", "json", "--since", "0", "--agent", &agent.socket()]);
    assert_eq!(run.json().as_array().unwrap().len(), 3);
}

#[test]
fn followed_events_go_on_where_the_list_ended() {
    let agent = Agent::new()
        .on_text("GET /v1/events?since=2&follow=true", 200, &format!("data: {}\n\n", event(3)))
        .on("GET /v1/events", 200, &json!([event(1), event(2)]));
    let run = sdr(&["events", "-f", "-o", "json", "--agent", &agent.socket()]);
    let lines: Vec<Value> =
        run.stdout.lines().map(|line| serde_json::from_str(line).unwrap()).collect();
    let sequences: Vec<_> = lines.iter().filter_map(|line| line["sequence"].as_u64()).collect();
    assert_eq!(sequences, [1, 2, 3]);
    assert_eq!(run.code, Some(1), "the agent ended the stream: {}", run.stderr);
}

#[test]
fn a_reader_that_was_too_slow_is_told_what_is_missing() {
    let lagged = format!("data: {}\n\nevent: lagged\ndata: 5\n\n", event(1));
    let agent = Agent::new()
        .on_text("GET /v1/events?since=0&follow=true", 200, &lagged)
        .on_text("GET /v1/events?since=1&follow=true", 200, &format!("data: {}\n\n", event(7)))
        .on("GET /v1/events?since=0", 200, &json!([]));
    let run = sdr(&["events", "-f", "--agent", &agent.socket()]);
    assert_eq!(run.stdout.lines().count(), 2);
    assert!(run.stderr.starts_with("sdr: 5 events are missing here\n"), "{}", run.stderr);
}

#[test]
fn logs_are_fetched_from_the_home_robots_agent() {
    let home = Agent::new().on_text("GET /v1/logs/moon/camera", 200, "one\ntwo\n");
    let answer = json!({
        "error": "camera runs on robot-3",
        "details": { "home": "robot-3", "api": home.socket() }
    });
    let near = Agent::new().on("GET /v1/logs/moon/camera", 404, &answer).on(
        "GET /v1/status",
        200,
        &status("active", true),
    );
    let run = sdr(&["logs", "camera", "--agent", &near.socket()]);
    assert_eq!((run.code, run.stdout.as_str()), (Some(0), "one\ntwo\n"));

    let run = sdr(&["logs", "camera", "-o", "json", "--agent", &near.socket()]);
    assert_eq!(run.stdout, "{\"line\":\"one\"}\n{\"line\":\"two\"}\n");
}

#[test]
fn logs_on_another_machine_say_where_they_are() {
    let answer = json!({
        "error": "camera runs on robot-3",
        "details": { "home": "robot-3", "api": "/not/here.sock" }
    });
    let near = Agent::new().on("GET /v1/logs/moon/camera", 404, &answer);
    let run = sdr(&["logs", "moon/camera", "--agent", &near.socket()]);
    assert_eq!(run.code, Some(1));
    assert!(
        run.stderr.contains("robot-3, whose agent listens at /not/here.sock"),
        "{}",
        run.stderr
    );
}

#[test]
fn a_reader_that_goes_away_ends_us_quietly() {
    let line = "x".repeat(100) + "\n";
    let agent = Agent::new().on_text("GET /v1/logs/moon/camera", 200, &line.repeat(20_000));
    let mut child = command(&["logs", "moon/camera", "--agent", &agent.socket()])
        .stdout(Stdio::piped())
        .stderr(Stdio::piped())
        .spawn()
        .unwrap();
    let mut first = String::new();
    BufReader::new(child.stdout.take().unwrap()).read_line(&mut first).unwrap();
    assert_eq!(first, line);
    let mut said = String::new();
    child.stderr.take().unwrap().read_to_string(&mut said).unwrap();
    assert_eq!((child.wait().unwrap().code(), said.as_str()), (Some(0), ""));
}

#[test]
fn completions_are_scripts_and_json_holds_one() {
    let run = sdr(&["completions", "bash"]);
    assert_eq!(run.code, Some(0));
    assert!(run.stdout.contains("_sdr()"), "{}", run.stdout);
    let run = sdr(&["completions", "zsh", "-o", "json"]);
    assert!(run.json()["script"].as_str().unwrap().starts_with("#compdef sdr"));
}
