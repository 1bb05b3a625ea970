//! What was said is in the file, however the agent ended.

use std::sync::Mutex;

use mcap::MessageStream;
use sdr_core::recording::{EventSample, RobotMetrics};
use serde::de::DeserializeOwned;

use super::*;

fn robot() -> RobotId {
    RobotId::new("robot-1").unwrap()
}

fn metrics(number: u64) -> RobotMetrics {
    RobotMetrics { robot: "robot-1".into(), memory_free_bytes: number, ..Default::default() }
}

fn body<T: DeserializeOwned>(cdr: &[u8]) -> T {
    assert_eq!(cdr[..4], [0, 1, 0, 0]);
    cdr_encoding::from_bytes::<T, byteorder::LittleEndian>(&cdr[4..]).unwrap().0
}

/// Topic, type, schema and body of every message in the file.
fn messages(bytes: &[u8]) -> Vec<(String, String, String, Vec<u8>)> {
    MessageStream::new(bytes)
        .unwrap()
        .map(|message| {
            let message = message.unwrap();
            let schema = message.channel.schema.clone().unwrap();
            assert_eq!(schema.encoding, "ros2msg");
            assert_eq!(message.channel.message_encoding, "cdr");
            let text = String::from_utf8(schema.data.to_vec()).unwrap();
            (message.channel.topic.clone(), schema.name.clone(), text, message.data.to_vec())
        })
        .collect()
}

#[test]
fn a_finished_recording_holds_every_message_with_its_schema() {
    let dir = tempfile::tempdir().unwrap();
    let recorder = Recorder::start(dir.path(), &robot(), u64::MAX, |_| {}).unwrap();
    let path = recorder.flusher().flush();
    for number in 0..50 {
        recorder.sender().record(number, &metrics(number));
    }
    let event = EventSample {
        kind: "placed".into(),
        number_names: vec!["memory_left_bytes".into()],
        number_values: vec![310e6],
        ..EventSample::default()
    };
    recorder.sender().record(50, &event);
    drop(recorder);

    let bytes = fs::read(path).unwrap();
    let summary = mcap::Summary::read(&bytes).unwrap().expect("a finished file has a summary");
    assert_eq!(summary.stats.unwrap().message_count, 51);
    let found = messages(&bytes);
    assert_eq!(found.len(), 51);
    let (topic, type_name, definition, cdr) = &found[7];
    assert_eq!(topic, "/sdr/robot_1/metrics");
    assert_eq!(type_name, "sdr_msgs/msg/RobotMetrics");
    assert!(definition.contains("uint64 memory_free_bytes"));
    assert_eq!(body::<RobotMetrics>(cdr), metrics(7));
    assert_eq!(body::<EventSample>(&found[50].3), event);
}

#[test]
fn a_recording_is_readable_while_it_is_written() {
    let dir = tempfile::tempdir().unwrap();
    let recorder = Recorder::start(dir.path(), &robot(), u64::MAX, |_| {}).unwrap();
    let flusher = recorder.flusher();

    for round in 1..=3_usize {
        recorder.sender().record(round as u64, &metrics(round as u64));
        let bytes = fs::read(flusher.flush()).unwrap();
        assert_eq!(messages(&bytes).len(), round);
    }
}

#[test]
fn log_times_never_go_back_and_publish_times_are_true() {
    let dir = tempfile::tempdir().unwrap();
    let recorder = Recorder::start(dir.path(), &robot(), u64::MAX, |_| {}).unwrap();

    for at in [5_000, 3_000, 4_000, 9_000] {
        recorder.sender().record(at, &metrics(at));
    }

    let bytes = fs::read(recorder.flusher().flush()).unwrap();
    let times: Vec<_> = MessageStream::new(&bytes)
        .unwrap()
        .map(|message| message.map(|message| (message.log_time, message.publish_time)).unwrap())
        .collect();
    let from_first = |time: u64| time + 5_000 - times[0].1;
    let found: Vec<_> =
        times.iter().map(|(log, publish)| (from_first(*log), from_first(*publish))).collect();
    assert_eq!(found, [(5_000, 5_000), (5_000, 3_000), (5_000, 4_000), (9_000, 9_000)]);
}

#[test]
fn a_full_recording_stops_and_says_so() {
    let dir = tempfile::tempdir().unwrap();
    let news = Arc::new(Mutex::new(Vec::new()));
    let theirs = Arc::clone(&news);
    let recorder = Recorder::start(dir.path(), &robot(), 1000, move |said| {
        theirs.lock().unwrap().push(said);
    })
    .unwrap();
    let sender = recorder.sender();
    let flusher = recorder.flusher();

    for _ in 0..20 {
        sender.message("/t", "std_msgs/msg/UInt8MultiArray", "uint8[] data", 1, vec![0; 100]);
    }
    let path = flusher.flush();
    drop(recorder);

    assert_eq!(*news.lock().unwrap(), [RecorderNews::Full { bytes: 1000 }]);
    assert_eq!(messages(&fs::read(path).unwrap()).len(), 10);
}
