//! Commands that read files.

use std::{fs, os::unix::fs::PermissionsExt, path::Path};

use serde_json::{Value, json};

use crate::{
    agent::Agent,
    asking::status,
    sdr::{Run, sdr},
};

const GOOD: &str = "\
system: moon
components:
  camera:
    run: { native: camera }
    parameters: { exposure: 3 }
  viewer:
    run: { native: viewer }
connections:
  - camera.image -> viewer.image
";

/// A folder with a file of this text, and executables that describe themselves.
fn folder(name: &str, text: &str) -> (tempfile::TempDir, String) {
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join(name);
    fs::write(&file, text).unwrap();
    for profile in profiles() {
        let program = folder.path().join(profile["name"].as_str().unwrap());
        fs::write(&program, format!("#!/bin/sh\necho '{profile}'\n")).unwrap();
        fs::set_permissions(&program, fs::Permissions::from_mode(0o755)).unwrap();
    }
    (folder, file.display().to_string())
}

fn profiles() -> [Value; 2] {
    let image = json!([{ "name": "image", "message_type": "sensor_msgs/msg/Image" }]);
    let exposure = json!([{ "name": "exposure", "default": 1 }]);
    [
        json!({ "name": "camera", "inputs": [], "outputs": image, "parameters": exposure }),
        json!({ "name": "viewer", "inputs": image, "outputs": [] }),
    ]
}

fn validate(folder: &Path, file: &str) -> Run {
    sdr(&["validate", file, "-o", "json", "--components", &folder.display().to_string()])
}

#[test]
fn a_good_system_is_fine_with_the_executables_own_ports() {
    let (folder, file) = folder("moon.yaml", GOOD);
    let run = validate(folder.path(), &file);
    assert_eq!(run.code, Some(0), "{}{}", run.stdout, run.stderr);
    let report = &run.json()[0];
    assert_eq!((&report["kind"], &report["ok"]), (&json!("system"), &json!(true)));
    assert_eq!(report["unchecked"], json!([]));
}

#[test]
fn a_bad_file_is_refused_with_line_column_and_what_is_allowed() {
    let cases = [
        ("moon.yaml", GOOD.replace("native", "natve"), 4),
        ("moon.yaml", GOOD.replace("-> viewer.image", "-> viewer.imag"), 9),
        ("moon.yaml", GOOD.replace("exposure: 3", "exposur: 3"), 5),
        ("moon.yaml", GOOD.replace("exposure: 3", "exposure: fast"), 5),
        ("moon.yaml", GOOD.replace("camera.image", "camra.image"), 9),
        ("robot.toml", "[robot]\nname = \"robot-1\"\ncolour = \"red\"\n".into(), 3),
    ];
    for (name, text, line) in cases {
        let (folder, file) = folder(name, &text);
        let run = validate(folder.path(), &file);
        assert_eq!(run.code, Some(1), "{text}");
        let report = run.json();
        let mut problems = report[0]["problems"].as_array().unwrap().iter();
        let problem = problems.find(|problem| problem["line"] == json!(line));
        let problem = problem.unwrap_or_else(|| panic!("line {line} of {text}: {report}"));
        assert!(problem["column"].as_u64().unwrap() > 0, "{problem}");
        assert_ne!(problem["found"], json!(""));
    }
}

#[test]
fn people_see_the_line_with_a_caret() {
    let (_folder, file) = folder("moon.yaml", &GOOD.replace("native: viewer", "natve: viewer"));
    let run = sdr(&["validate", &file]);
    assert_eq!(run.code, Some(1));
    assert!(run.stdout.contains(&format!("{file}:7:")), "{}", run.stdout);
    assert!(run.stdout.contains("\n    | ") && run.stdout.contains('^'), "{}", run.stdout);
    assert!(run.stdout.ends_with("system, 1 problem\n"), "{}", run.stdout);
}

#[test]
fn executables_that_are_missing_are_said_and_are_no_problem_of_the_file() {
    let (folder, file) = folder("moon.yaml", GOOD);
    fs::remove_file(folder.path().join("viewer")).unwrap();
    let run = validate(folder.path(), &file);
    assert_eq!(run.code, Some(0), "{}", run.stdout);
    let reasons = run.json()[0]["unchecked"].to_string();
    assert!(reasons.contains("viewer"), "{reasons}");
}

#[test]
fn the_kind_of_a_file_is_told_from_its_keys() {
    let recovery = "recovery: none\nladders: {}\nrules: []\n";
    let allocation = "allocation: plain\nstrategy: first-fit\n";
    for (text, kind) in [(recovery, "recovery"), (allocation, "allocation"), (GOOD, "system")] {
        let (folder, file) = folder("file.yaml", text);
        assert_eq!(validate(folder.path(), &file).json()[0]["kind"], json!(kind));
    }
}

#[test]
fn a_file_that_is_not_there_is_told() {
    let run = sdr(&["validate", "/nowhere/moon.yaml"]);
    assert_eq!(run.code, Some(1));
    assert!(run.stdout.contains("/nowhere/moon.yaml: cannot be read"), "{}", run.stdout);
}

#[test]
fn a_bad_system_is_refused_before_the_agent_is_asked_anything() {
    let (_folder, file) = folder("moon.yaml", &GOOD.replace("native", "natve"));
    let agent = Agent::new();
    let run = sdr(&["deploy", &file, "-o", "json", "--agent", &agent.socket()]);
    assert_eq!(run.code, Some(1));
    assert_eq!(run.json()["problems"][0]["line"], json!(4));
    assert_eq!(agent.asked(), [""; 0]);
}

fn deploying() -> Agent {
    Agent::new()
        .on("GET /v1/components", 200, &json!({ "components": profiles(), "undescribed": {} }))
        .on("POST /v1/deploy", 200, &json!({ "system": "moon", "revision": 1, "changed": true }))
}

#[test]
fn ports_are_checked_before_anything_is_sent() {
    let (_folder, file) = folder("moon.yaml", &GOOD.replace("viewer.image", "viewer.picture"));
    let agent = deploying();
    let run = sdr(&["deploy", &file, "--agent", &agent.socket()]);
    assert_eq!(run.code, Some(1));
    assert!(run.stderr.contains(":9:") && run.stderr.contains('^'), "{}", run.stderr);
    assert!(run.stderr.ends_with("sdr: 1 problem; nothing was deployed\n"), "{}", run.stderr);
    assert!(!agent.asked().iter().any(|request| request.starts_with("POST")));
}

#[test]
fn a_deployment_is_up_when_all_are_active_and_heard() {
    let (_folder, file) = folder("moon.yaml", GOOD);
    let mut absent = status("inactive", false);
    absent["systems"] = json!([]);
    let agent = deploying()
        .on("GET /v1/status", 200, &absent)
        .on("GET /v1/status", 200, &status("inactive", false))
        .on("GET /v1/status", 200, &status("active", false))
        .on("GET /v1/status", 200, &status("active", true));
    let run = sdr(&["deploy", &file, "--wait", "--agent", &agent.socket()]);
    assert_eq!((run.code, run.stderr.as_str()), (Some(0), ""));
    for line in ["moon: 0 of 1 active", "moon: 1 of 1 active, 1 of 1 connections heard", "is up"] {
        assert!(run.stdout.contains(line), "{line}: {}", run.stdout);
    }
    assert!(!run.stdout.contains('\u{1b}'), "piped output is plain: {}", run.stdout);
    let sent = agent.asked().into_iter().find(|request| request.starts_with("POST")).unwrap();
    assert!(sent.contains("sensor_msgs/msg/Image"), "{sent}");
}

#[test]
fn a_wait_that_is_over_says_what_is_awaited_and_why() {
    let (_folder, file) = folder("moon.yaml", GOOD);
    let mut homeless = status("active", true);
    let mut viewer = homeless["systems"][0]["components"][0].clone();
    viewer["name"] = json!("viewer");
    viewer["state"] = json!("created");
    viewer["restarts"] = json!(2);
    homeless["systems"][0]["components"].as_array_mut().unwrap().push(viewer);
    let component = &mut homeless["systems"][0]["components"][0];
    component["home"] = Value::Null;
    component["reason"] = json!("no robot fits");
    component["refusals"] = json!([{
        "robot": "robot-1", "constraint": "memory_free", "found": "310 MB", "bar": "500 MB"
    }]);
    let exited = json!({
        "sequence": 1, "wall_ms": 0, "monotonic_ns": 0, "kind": "exited", "robot": "robot-1",
        "system": "moon", "component": "viewer", "reason": "exit status 3"
    });
    let agent = deploying().on("GET /v1/status", 200, &homeless).on(
        "GET /v1/events",
        200,
        &json!([exited]),
    );
    let arguments = ["deploy", &file, "--wait", "--timeout", "1ms", "-o", "json", "--agent"];
    let run = sdr(&[&arguments[..], &[&agent.socket()]].concat());
    assert_eq!(run.code, Some(1));
    let report = run.json();
    assert_eq!(report["done"], json!(false));
    assert_eq!(report["progress"]["awaited"][0]["refusals"][0]["bar"], json!("500 MB"));
    for line in [
        "  camera has no home: no robot fits\n",
        "    robot-1: memory_free 310 MB, bar 500 MB\n",
        "  viewer is created on robot-1 after 2 restarts: first that fits\n",
        "    last: exited: exit status 3\n",
    ] {
        assert!(run.stderr.contains(line), "{line}: {}", run.stderr);
    }
}

#[test]
fn a_policy_is_explained_in_words_and_a_bad_one_refused_with_its_place() {
    let built_in = sdr(&["policy", "explain"]);
    assert_eq!(built_in.code, Some(0), "{}", built_in.stderr);
    assert!(built_in.stdout.contains("battery-low: charge of the robot is at most 15 % for 10 s"));

    let mine = "recovery: mine\nextends: default\nrules:\n  - { cause: odd, when: robot.cpu > 0.5, \
                ladder: elsewhere }\n";
    let (_folder, file) = folder("mine.yaml", mine);
    let rules = &sdr(&["policy", "explain", &file, "-o", "json"]).json()["rules"];
    let odd = rules.as_array().unwrap().iter().find(|rule| rule["cause"] == "odd").unwrap();
    assert_eq!(odd["when"], "`robot.cpu > 0.5` is true");
    assert_eq!(odd["over"], "when that is not so");

    let (_folder, file) = folder("bad.yaml", &mine.replace("robot.cpu", "robot.cup"));
    let bad = sdr(&["policy", "explain", &file]);
    assert_eq!(bad.code, Some(1));
    let told = format!("{}{}", bad.stdout, bad.stderr);
    assert!(told.contains("unknown fact `robot.cup`"), "{told}");
}
