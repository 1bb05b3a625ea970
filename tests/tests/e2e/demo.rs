//! The main job, end to end.

use std::{
    path::{Path, PathBuf},
    process::{Command, Stdio},
};

use rustix::process::{Pid, Signal, kill_process};
use sdr_tests::house::{LIMIT, programs, wait_for};
use serde_json::Value;

const FIVE: [&str; 5] = ["fisheye", "anomaly", "camera", "controller", "position"];

/// The shared memory of agents that exist now.
fn shared_memory() -> Vec<PathBuf> {
    let list = |folder: &str| {
        let entries = std::fs::read_dir(folder).into_iter().flatten().flatten();
        entries.map(|entry| entry.path()).collect::<Vec<_>>()
    };
    list("/dev/shm/sdr")
}

/// Where the Python tests find the recordings of this run.
fn recordings() -> PathBuf {
    let target = programs().folder().parent().unwrap().to_path_buf();
    target.join("test-recordings")
}

#[test]
fn the_demo_places_five_moves_two_and_reports() {
    let out = recordings();
    let _ = std::fs::remove_dir_all(&out);
    let before = shared_memory();
    let output = Command::new(programs().sdr())
        .args(["demo", "--no-ballast", "--coordinator", "robot-2", "-o", "json", "--out"])
        .arg(&out)
        .output()
        .unwrap();
    let errors = String::from_utf8_lossy(&output.stderr).into_owned();
    assert!(output.status.success(), "{errors}");

    let report: Value = serde_json::from_slice(&output.stdout).expect("stdout is report.json");
    let homes =
        |field: &str| FIVE.map(|name| report[field][name].as_str().unwrap_or("").to_string());
    assert_eq!(homes("placement_before"), ["robot-1", "robot-1", "robot-2", "robot-2", "robot-3"]);
    assert_eq!(homes("placement_after"), ["robot-3", "robot-3", "robot-2", "robot-2", "robot-3"]);
    assert_eq!(FIVE.map(|name| report["epochs"][name].as_u64()), [2, 2, 1, 1, 1].map(Some));
    for figure in ["activation_ms", "recovery_ms"] {
        assert!(report[figure].as_f64().is_some_and(|value| value > 0.0), "{figure}: {report:#}");
    }
    assert_eq!(report["samples"].as_object().unwrap().len(), 5, "{report:#}");
    assert_eq!(report["stream_gap_ms"].as_object().unwrap().len(), 5);
    assert_eq!(report["agents"].as_object().unwrap().len(), 3);
    assert!(report["controller_gap_ms"].is_object(), "{report:#}");
    check_files(&out, &report);
    for left in shared_memory() {
        assert!(before.contains(&left), "{} was left behind", left.display());
    }
}

fn check_files(out: &Path, report: &Value) {
    let page = std::fs::read_to_string(out.join("report.html")).unwrap();
    for words in ["Figure 3", "Figure 4", "Figure 5", "Figure 6", "Table IV", "310 MB"] {
        assert!(page.contains(words), "report.html lacks {words}");
    }
    let kept: Value =
        serde_json::from_slice(&std::fs::read(out.join("report.json")).unwrap()).unwrap();
    assert_eq!(&kept, report, "the file and stdout differ");
    let recordings = report["recordings"].as_array().unwrap();
    assert_eq!(recordings.len(), 3);
}

#[test]
fn an_interrupted_demo_leaves_nothing_behind() {
    let out = tempfile::tempdir().unwrap();
    let temporary = tempfile::tempdir().unwrap();
    let mut demo = Command::new(programs().sdr())
        .args(["demo", "--no-ballast", "--out"])
        .arg(out.path().join("report"))
        .env("TMPDIR", temporary.path())
        .stdout(Stdio::null())
        .stderr(Stdio::null())
        .spawn()
        .unwrap();
    let before = shared_memory();
    let up = wait_for(LIMIT, || shared_memory().len() >= before.len() + 3);
    assert!(up, "the fleet never came up");
    let ours: Vec<PathBuf> =
        shared_memory().into_iter().filter(|path| !before.contains(path)).collect();

    kill_process(Pid::from_child(&demo), Signal::INT).unwrap();

    let ended = wait_for(LIMIT, || matches!(demo.try_wait(), Ok(Some(_))));
    assert!(ended, "the demo did not end");
    let left: Vec<&PathBuf> = ours.iter().filter(|path| path.exists()).collect();
    // other tests of this machine come and go: only what this demo made counts
    assert!(left.len() < 3, "left behind: {left:?}");
    assert_eq!(std::fs::read_dir(temporary.path()).unwrap().count(), 0);
}
