//! Real programs: shell scripts in a folder.

use std::fs;
use std::os::unix::fs::PermissionsExt as _;
use std::time::Duration;

use sdr_core::{
    id::{ComponentKey, Name},
    recover::{Evidence, Otherwise, Program, RobotEvidence, Spread},
    units::{Bytes, Dbm, Permille},
};
use tempfile::TempDir;

use super::*;

/// More than any of these programs needs, on any machine.
const PATIENCE: Duration = Duration::from_secs(60);

fn name(word: &str) -> Name {
    Name::new(word).unwrap()
}

fn evidence() -> Evidence {
    Evidence {
        component: ComponentKey::new(&name("watch"), &name("camera")),
        actuator: false,
        fault: None,
        standby_here: false,
        standby_elsewhere: true,
        memory: Bytes::mega(530),
        cpu: Permille(250),
        cpu_limit: Permille(0),
        deadlines_missed: 3,
        inputs_late: 0,
        told: vec![],
        robot: RobotEvidence {
            memory_free: Some(Bytes::mega(200)),
            rssi: Some(Dbm::from_tenths(-525)),
            loss: Some(Spread { best: Permille(0), median: Permille(100), worst: Permille(1000) }),
            ..RobotEvidence::default()
        },
    }
}

/// Asks a program with this text; what comes back.
async fn ask(script: &str, limit: Duration) -> Result<Vec<Finding>, String> {
    let dir = TempDir::new().unwrap();
    let file = dir.path().join("mine.sh");
    fs::write(&file, format!("#!/bin/sh\n{script}\n")).unwrap();
    fs::set_permissions(&file, fs::Permissions::from_mode(0o755)).unwrap();
    ask_in(&dir, limit).await
}

async fn ask_in(dir: &TempDir, limit: Duration) -> Result<Vec<Finding>, String> {
    let (sender, mut inputs) = mpsc::channel(1);
    let robot = RobotId::new("robot-1").unwrap();
    let programs = Programs::new(robot, vec![dir.path().into()], sender);
    let order = ProgramOrder {
        question: 7,
        program: Program {
            command: vec!["mine.sh".into(), "an argument".into()],
            every: Duration::from_secs(1),
            limit,
            otherwise: Otherwise::Ignore,
        },
        system: name("watch"),
        evidence: vec![evidence()],
    };
    let local = tokio::task::LocalSet::new();
    let answer = async {
        programs.ask(order);
        inputs.recv().await.unwrap()
    };
    let Input::Told { question, result } = local.run_until(answer).await else {
        panic!("no answer")
    };
    assert_eq!(question, 7);
    result
}

#[tokio::test]
async fn a_program_gets_facts_and_finds_causes() {
    let script = r#"facts=$(cat); case "$facts" in
        *'"v":1,"system":"watch"'*'"rssi_dbm":-52.5'*'"deadlines_missed":3'*'"worst":1.0'*)
            echo "{\"causes\":[{\"component\":\"camera\",\"cause\":\"cooking\",\"reason\":\"$1\"}]}";;
        *) echo "$facts" >&2; exit 3;;
    esac"#;

    let found = ask(script, PATIENCE).await.unwrap();

    let cause = sdr_core::recover::Cause::from_word("cooking").ok();
    let reason = String::from("an argument");
    assert_eq!(found, [Finding { component: name("camera"), cause, reason }]);
}

#[tokio::test]
async fn one_that_does_not_read_its_facts_may_still_say_that_all_is_well() {
    assert_eq!(ask("exec <&-; echo '{\"causes\":[]}'", PATIENCE).await, Ok(vec![]));
}

#[tokio::test]
async fn what_is_no_answer_is_an_error_that_says_why() {
    for (script, why) in [
        ("exit 3", "exit status: 3"),
        ("echo no battery >&2; exit 1", "exit status: 1: no battery"),
        ("echo hello", "answers no {\"causes\": [..]}"),
        ("echo '{\"causes\":[{\"component\":\"Not a name\"}]}'", "Not a name"),
        ("echo '{\"causes\":[],\"more\":1}'", "unknown field `more`"),
        ("head -c 70000 /dev/zero", "more than 65536 bytes"),
    ] {
        let error = ask(script, PATIENCE).await.unwrap_err();
        assert!(error.contains(why), "{script}: {error}");
    }
}

#[tokio::test]
async fn one_that_takes_too_long_is_ended() {
    let error = ask("exec sleep 600", Duration::from_millis(50)).await.unwrap_err();
    assert_eq!(error, "ended after 50 ms without an answer");
}

#[tokio::test]
async fn one_that_is_not_there_is_named() {
    let error = ask_in(&TempDir::new().unwrap(), PATIENCE).await.unwrap_err();
    assert!(error.contains("mine.sh"), "{error}");
}
