//! A report from recordings written as an agent writes them.

mod known;
pub(crate) mod story;

use super::*;
use story::{MS, Story};

#[test]
fn the_contract_fields_are_there_and_hold_what_was_recorded() {
    let folder = tempfile::tempdir().unwrap();
    Story::whole().write(folder.path());

    let report = Report::make(&[folder.path().to_owned()], story::extra()).unwrap();
    let json = serde_json::to_value(&report.summary).unwrap();

    assert_eq!(json["activation_ms"], 900.0);
    // Hold time over at 20.980, 20 ms before the event; fisheye heard at 21.300, anomaly at 21.380.
    assert_eq!(json["recovery_ms"], 400.0);
    assert_eq!(json["placement_before"]["fisheye"], "robot-1");
    assert_eq!(json["placement_after"]["fisheye"], "robot-3");
    assert_eq!(json["placement_after"]["controller"], "robot-2");
    assert_eq!(json["epochs"]["anomaly"], 2);
    assert_eq!(json["epochs"]["camera"], 1);
    let samples = &json["samples"]["anomaly.danger -> controller.danger"];
    assert_eq!((&samples["received"], &samples["lost"]), (&270.into(), &1.into()));
    let samples = &json["samples"]["fisheye.image -> anomaly.image"];
    assert_eq!((&samples["sent"], &samples["received"]), (&400.into(), &200.into()));
    assert_eq!((&samples["lost"], &samples["unheard"]), (&0.into(), &200.into()));
    let gap = &json["stream_gap_ms"]["fisheye.image -> anomaly.image"];
    assert_eq!((&gap["gap_max_ms"], &gap["period_median_ms"]), (&105.0.into(), &66.0.into()));
    assert_eq!(json["controller_gap_ms"]["max"], 24.0);
    assert_eq!(json["controller_gap_ms"]["period_median_ms"], 20.0);
    assert_eq!(json["agents"]["robot-2"]["rss_bytes"], 15_000_000);
    assert_eq!(json["coordinator"]["at_start"], "robot-2");
    assert_eq!(json["ballast"], true);
    assert!(json["position_error_m"]["mean"].as_f64().unwrap() < 0.11);
    assert_eq!(json["detector"]["stops"], 1);
    assert_eq!(json["verdicts"], serde_json::json!({ "all": 101, "danger": 31 }));
    assert_eq!(json["recordings"].as_array().unwrap().len(), 3);
    assert_eq!(json["notes"].as_array().unwrap().len(), 0);
}

#[test]
fn a_pause_while_the_next_home_got_ready_counts_and_is_told() {
    let gap = |foreseen_ms: Option<u64>| {
        let folder = tempfile::tempdir().unwrap();
        let mut story = Story::whole();
        story.silence(19_100, 1700);
        foreseen_ms.into_iter().for_each(|at_ms| story.foresee(at_ms));
        story.write(folder.path());
        let report = Report::make(&[folder.path().to_owned()], story::extra()).unwrap();
        let json = serde_json::to_value(&report.summary).unwrap();
        let gap = &json["stream_gap_ms"]["anomaly.danger -> controller.danger"];
        (gap["gap_max_ms"].as_f64().unwrap(), report.summary.notes.join("\n"))
    };

    let (late, silent) = gap(None);
    assert_eq!((late, silent.as_str()), (67.0, ""));
    let (whole, told) = gap(Some(18_000));
    assert_eq!(whole, 1700.0);
    assert!(told.contains("anomaly.danger -> controller.danger paused for 1.70 s"), "{told}");
}

#[test]
fn pictures_instead_of_the_world_are_told_and_so_is_an_unknown_build() {
    let folder = tempfile::tempdir().unwrap();
    Story::whole().write(folder.path());
    let mut extra = story::extra();
    extra.pictures = Some("12 pictures in /photos".to_owned());
    extra.machine = Some(Machine { commit: None, ..extra.machine.unwrap() });

    let report = Report::make(&[folder.path().to_owned()], extra).unwrap();

    let notes = report.summary.notes.join("\n");
    assert!(notes.contains("the cameras showed 12 pictures in /photos"), "{notes}");
    assert!(notes.contains("commit of this build unknown"), "{notes}");
}

#[test]
fn what_was_not_recorded_is_null_and_never_zero() {
    let folder = tempfile::tempdir().unwrap();
    Story::bare().write(folder.path());

    let report = Report::make(&[folder.path().to_owned()], Extra::default()).unwrap();
    let json = serde_json::to_value(&report.summary).unwrap();

    for field in [
        "activation_ms",
        "recovery_ms",
        "controller_gap_ms",
        "position_error_m",
        "detector",
        "machine",
        "ballast",
        "radio",
    ] {
        assert_eq!(json[field], serde_json::Value::Null, "{field}");
    }
    assert_eq!(json["coordinator"]["at_start"], serde_json::Value::Null);
    assert!(!page::page(&report).contains("NaN"));
}

#[test]
fn a_component_that_never_ran_makes_the_activation_unknown_and_says_so() {
    let folder = tempfile::tempdir().unwrap();
    Story::whole().write(folder.path());
    let mut extra = story::extra();
    extra.components.push("gripper".to_owned());

    let report = Report::make(&[folder.path().to_owned()], extra).unwrap();

    assert_eq!(report.summary.activation_ms, None);
    assert!(report.summary.notes.iter().any(|note| note == "gripper never active"));
    assert!(page::page(&report).contains("gripper never active"));
}

#[test]
fn the_page_stands_alone_and_shows_every_figure() {
    let folder = tempfile::tempdir().unwrap();
    Story::whole().write(folder.path());
    let out = folder.path().join("out");

    let report = Report::make(&[folder.path().to_owned()], story::extra()).unwrap();
    let page = fs::read_to_string(report.write(&out).unwrap()).unwrap();

    for part in [
        "Figure 3-(1)",
        "Figure 3-(2)",
        "Figure 4:",
        "Figure 5:",
        "Figure 6:",
        "16 s",
        "11 s",
        "Table V: 500 MB",
        "Table VI: -52.5 dBm",
        "mark allocation",
        "mark recovery",
        "Table IV of this run",
        "robot-1 310 MB, bar 500 MB",
        "edge memory",
        "edge dds",
    ] {
        assert!(page.contains(part), "{part}");
    }
    for outside in ["<script", "src=", "href=", "url(", "@import", "NaN"] {
        assert!(!page.contains(outside), "{outside}");
    }
    let json = fs::read(out.join("report.json")).unwrap();
    assert!(serde_json::from_slice::<serde_json::Value>(&json).unwrap()["format"] == 1);
}

#[test]
fn the_same_report_comes_from_the_folder_again() {
    let folder = tempfile::tempdir().unwrap();
    Story::whole().write(folder.path());
    let text = serde_json::to_string(&story::extra()).unwrap();
    fs::write(folder.path().join(extra::FILE), text).unwrap();

    let loaded = Extra::load(folder.path()).unwrap().unwrap();

    let report = |extra| Report::make(&[folder.path().to_owned()], extra).unwrap();
    let json = |extra| serde_json::to_string(&report(extra).summary).unwrap();
    assert!(json(loaded) == json(story::extra()), "another report");
    fs::write(folder.path().join(extra::FILE), "{").unwrap();
    assert!(Extra::load(folder.path()).unwrap_err().contains("left out"));
}

#[test]
fn a_recording_that_ends_early_is_used_as_far_as_it_goes() {
    let folder = tempfile::tempdir().unwrap();
    let files = Story::whole().write(folder.path());
    let bytes = fs::read(&files[0]).unwrap();
    fs::write(&files[0], &bytes[..bytes.len() - 30]).unwrap();

    let report = Report::make(&[folder.path().to_owned()], story::extra()).unwrap();

    assert_eq!(report.run.robots.len(), 3);
}

#[test]
fn what_is_no_recording_is_refused_with_its_name() {
    let folder = tempfile::tempdir().unwrap();
    let message = |paths: &[PathBuf]| match Report::make(paths, Extra::default()) {
        Err(Failure::Failed(answer)) => answer.error,
        _ => panic!("refused"),
    };
    assert!(message(&[folder.path().to_owned()]).contains("no recording"));
    let file = folder.path().join("x.mcap");
    assert!(message(std::slice::from_ref(&file)).contains("x.mcap"));
    fs::write(&file, b"something else entirely, and long enough").unwrap();
    assert!(message(std::slice::from_ref(&file)).contains("x.mcap is no recording"));
}

#[test]
fn clearing_up_afterwards_is_no_part_of_the_run() {
    let folder = tempfile::tempdir().unwrap();
    Story::whole().write(folder.path());
    let mut extra = story::extra();
    extra.until_ns = Some(10_000 * MS);

    let report = Report::make(&[folder.path().to_owned()], extra).unwrap();

    assert!(report.figures.moves.is_empty());
    assert_eq!(report.summary.placement_after["fisheye"], "robot-1");
    assert_eq!(report.summary.recovery_ms, None);
}
