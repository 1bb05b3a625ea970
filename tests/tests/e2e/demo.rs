//! The main job, end to end.

use std::{
    collections::BTreeSet,
    path::{Path, PathBuf},
    process::{Command, Stdio},
};

use rustix::process::{Pid, Signal, kill_process};
use sdr_tests::house::{LIMIT, is_running, programs, wait_for};
use serde_json::Value;

const FIVE: [&str; 5] = ["fisheye", "anomaly", "camera", "controller", "position"];

/// Processes whose environment names `folder`: all that a demo with this TMPDIR started.
pub(super) fn processes_of(folder: &Path) -> Vec<u32> {
    let words = folder.to_string_lossy().into_owned();
    let entries = std::fs::read_dir("/proc").into_iter().flatten().flatten();
    entries
        .filter_map(|entry| entry.file_name().to_string_lossy().parse().ok())
        .filter(|pid| {
            let environment = std::fs::read(format!("/proc/{pid}/environ")).unwrap_or_default();
            is_running(*pid) && String::from_utf8_lossy(&environment).contains(&words)
        })
        .collect()
}

/// Files of shared memory that these processes hold.
fn shared_memory_of(pids: &[u32]) -> BTreeSet<PathBuf> {
    let held = pids.iter().flat_map(|pid| {
        let maps = std::fs::read_to_string(format!("/proc/{pid}/maps")).unwrap_or_default();
        let mapped: Vec<PathBuf> = maps
            .lines()
            .filter_map(|line| line.find("/dev/shm/").map(|at| PathBuf::from(&line[at..])))
            .collect();
        let opened = std::fs::read_dir(format!("/proc/{pid}/fd")).into_iter().flatten().flatten();
        mapped.into_iter().chain(opened.filter_map(|entry| std::fs::read_link(entry.path()).ok()))
    });
    held.filter(|path| path.starts_with("/dev/shm") && path.exists()).collect()
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
    let temporary = tempfile::tempdir().unwrap();
    let output = Command::new(programs().sdr())
        .args(["demo", "--no-ballast", "--coordinator", "robot-2", "-o", "json", "--out"])
        .arg(&out)
        .env("TMPDIR", temporary.path())
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
    let samples = report["samples"].as_object().unwrap();
    assert_eq!(samples.len(), 5, "{report:#}");
    for (connection, counts) in samples {
        // The demo looks on for 4 s after the move: a stream that stopped is silent for most of it.
        let silent = counts["silent_ms"].as_f64();
        assert!(silent.is_some_and(|ms| ms < 2000.0), "{connection} stopped: {report:#}");
    }
    assert_eq!(report["stream_gap_ms"].as_object().unwrap().len(), 5);
    assert_eq!(report["agents"].as_object().unwrap().len(), 3);
    assert!(report["controller_gap_ms"].is_object(), "{report:#}");
    check_files(&out, &report);
    assert_eq!(processes_of(temporary.path()), Vec::<u32>::new());
    assert_eq!(std::fs::read_dir(temporary.path()).unwrap().count(), 0);
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
    let mut pids = Vec::new();
    let mut memory = BTreeSet::new();
    let up = wait_for(LIMIT, || {
        pids = processes_of(temporary.path());
        memory = shared_memory_of(&pids);
        // the demo, three agents, five components
        pids.len() >= 9 && !memory.is_empty()
    });
    assert!(up, "the fleet never came up: {pids:?} {memory:?}");

    kill_process(Pid::from_child(&demo), Signal::INT).unwrap();

    let ended = wait_for(LIMIT, || matches!(demo.try_wait(), Ok(Some(_))));
    assert!(ended, "the demo did not end");
    let lives: Vec<&u32> = pids.iter().filter(|pid| is_running(**pid)).collect();
    assert!(lives.is_empty(), "processes left behind: {lives:?}");
    let left: Vec<&PathBuf> = memory.iter().filter(|path| path.exists()).collect();
    assert!(left.is_empty(), "shared memory left behind: {left:?}");
    assert_eq!(std::fs::read_dir(temporary.path()).unwrap().count(), 0);
}
