//! Scenarios of the lab, the short ones: real agents, real packets, a played radio.

use std::{
    io::Write as _,
    path::{Path, PathBuf},
    process::{Command, Output, Stdio},
};

use sdr_tests::house::{LIMIT, programs, wait_for};
use serde_json::Value;

use super::demo::processes_of;

fn scenario(name: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("scenarios").join(format!("{name}.yaml"))
}

fn run(file: &Path, folder: &Path) -> Output {
    Command::new(programs().sdr())
        .args(["lab", "run", "-o", "json", "--out"])
        .arg(folder.join("out"))
        .arg(file)
        .env("TMPDIR", folder)
        .output()
        .unwrap()
}

/// Whether this machine lets nobody make the lab's robots. In CI that is a failure.
fn is_refused(output: &Output) -> bool {
    let told = String::from_utf8_lossy(&output.stderr);
    if !told.contains("this machine refuses the lab's robots") {
        return false;
    }
    assert!(std::env::var_os("CI").is_none(), "CI must be able to run the lab: {told}");
    // Straight to the terminal: the test runner keeps what a passing test prints.
    let _ = writeln!(std::io::stderr(), "SKIPPED, namespaces are refused: {told}");
    true
}

/// Plays a scenario; all that it expects must come true, and nothing of it may stay.
fn comes_true(name: &str) {
    let folder = tempfile::tempdir().unwrap();
    let output = run(&scenario(name), folder.path());
    if is_refused(&output) {
        return;
    }
    let told = String::from_utf8_lossy(&output.stderr).into_owned();
    let answer: Value = serde_json::from_slice(&output.stdout)
        .unwrap_or_else(|error| panic!("{name}: no answer ({error})\n{told}"));
    assert!(output.status.success() && answer["met"] == true, "{name}:\n{told}");
    assert!(!answer["expectations"].as_array().unwrap().is_empty());
    for file in ["report.html", "report.json", "lab.json"] {
        assert!(folder.path().join("out").join(file).is_file(), "{name}: no {file}");
    }
    let left: Vec<_> = std::fs::read_dir(folder.path()).unwrap().flatten().collect();
    assert_eq!(left.len(), 1, "{name} left something behind: {left:?}");
}

macro_rules! scenarios {
    ($($claim:ident: $name:literal;)*) => {$(
        #[test]
        fn $claim() {
            comes_true($name);
        }
    )*};
}
scenarios! {
    a_component_that_hangs_is_killed_and_restarted: "hang";
    a_component_leaves_a_robot_whose_battery_sags: "battery_sag";
    a_robot_that_lost_its_power_brings_its_own_back: "power_cycle_one";
    another_robot_coordinates_when_the_coordinator_is_gone: "coordinator_killed";
}

#[test]
fn an_expectation_that_does_not_come_true_is_told_with_its_line() {
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("vain.yaml");
    let text = "scenario: vain\nrobots: { robot-1: {}, robot-2: {} }\ntimeline:\n  \
                - { at: 0s, expect: { robot: robot-2, seen: gone, within: 300ms } }\n";
    std::fs::write(&file, text).unwrap();

    let output = run(&file, folder.path());

    if is_refused(&output) {
        return;
    }
    assert_eq!(output.status.code(), Some(1));
    let answer: Value = serde_json::from_slice(&output.stdout).unwrap();
    let verdict = &answer["expectations"][0];
    assert_eq!((&verdict["met"], &verdict["line"]), (&Value::from(false), &Value::from(4)));
    assert!(verdict["found"].as_str().unwrap().contains("1 of 1 see robot-2 alive"), "{verdict}");
}

#[test]
fn a_run_that_is_killed_leaves_no_process_and_its_folder_goes_with_the_next() {
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("long.yaml");
    let text = "scenario: long\nrobots: { robot-1: {}, robot-2: {} }\ntimeline: []\nends: 20min\n";
    std::fs::write(&file, text).unwrap();
    let mut lab = Command::new(programs().sdr())
        .args(["lab", "run", "--out"])
        .arg(folder.path().join("out"))
        .arg(&file)
        .env("TMPDIR", folder.path())
        .stderr(Stdio::piped())
        .stdout(Stdio::null())
        .spawn()
        .unwrap();
    // The one we started, and for each robot: who holds it, who boots it, its first process, its agent.
    let all = wait_for(LIMIT, || {
        processes_of(folder.path()).len() >= 9 || lab.try_wait().unwrap().is_some()
    });
    if lab.try_wait().unwrap().is_some() {
        assert!(is_refused(&lab.wait_with_output().unwrap()), "it ended by itself");
        return;
    }
    assert!(all, "two robots run");

    lab.kill().unwrap();
    lab.wait().unwrap();

    let gone = wait_for(LIMIT, || processes_of(folder.path()).is_empty());
    assert!(gone, "{:?}", processes_of(folder.path()));
    let lying = |name: &str| {
        let entries = std::fs::read_dir(folder.path()).unwrap().flatten();
        entries.filter(|entry| entry.file_name().to_string_lossy().starts_with(name)).count()
    };
    assert_eq!(lying("sdr-lab-"), 1);
    std::fs::write(&file, text.replace("ends: 20min", "ends: 0s")).unwrap();
    assert!(run(&file, folder.path()).status.success());
    assert_eq!(lying("sdr-lab-"), 0);
}
