//! Commands that change something and wait for it.

use serde_json::json;

use crate::{agent::Agent, asking::status, sdr::sdr};

#[test]
fn an_undeployed_system_is_awaited_until_it_is_gone() {
    let mut gone = status("active", true);
    gone["systems"] = json!([]);
    let agent = Agent::new()
        .on("DELETE /v1/systems/moon", 200, &json!({}))
        .on("GET /v1/status", 200, &status("active", true))
        .on("GET /v1/status", 200, &gone);
    let run = sdr(&["undeploy", "moon", "--wait", "--agent", &agent.socket()]);
    assert_eq!((run.code, run.stderr.as_str()), (Some(0), ""));
    assert!(run.stdout.contains("camera: active on robot-1"), "{}", run.stdout);
    assert!(run.stdout.ends_with("moon: gone\n"), "{}", run.stdout);
}

#[test]
fn a_system_that_stays_is_told_when_the_time_is_over() {
    let agent = Agent::new().on("DELETE /v1/systems/moon", 200, &json!({})).on(
        "GET /v1/status",
        200,
        &status("active", true),
    );
    let arguments = ["undeploy", "moon", "--wait", "--timeout", "1ms", "-o", "json", "--agent"];
    let run = sdr(&[&arguments[..], &[&agent.socket()]].concat());
    assert_eq!(run.code, Some(1));
    assert_eq!(run.json(), json!({ "system": "moon", "gone": false }));
    assert!(run.stderr.contains("sdr: moon is not gone after 0.001 s"), "{}", run.stderr);
}

#[test]
fn the_agents_refusal_is_told_in_its_own_words() {
    let refusal = json!({ "error": "no system `sun`", "details": { "known": "moon" } });
    let agent = Agent::new().on("DELETE /v1/systems/sun", 404, &refusal);
    let run = sdr(&["undeploy", "sun", "--agent", &agent.socket()]);
    assert_eq!(run.code, Some(1));
    assert_eq!(run.stderr, "sdr: no system `sun`\n  known: moon\n");
    assert_eq!(agent.asked().len(), 1);
}
