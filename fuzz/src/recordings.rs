//! Recordings with any messages in them.

use std::{collections::BTreeMap, io::Cursor};

use mcap::{WriteOptions, Writer, records::MessageHeader};
use sdr_core::recording::{
    ComponentSample, ConnectionSample, EventSample, OutputSample, Recorded, RobotMetrics,
};

use crate::bytes::Choices;

const MESSAGES_MAX: usize = 32;

/// Types of messages that a report looks at, with their topics and schemas.
pub const TYPES: [(&str, &str, &str); 7] = [
    (RobotMetrics::TYPE, "/sdr/robot_1/metrics", RobotMetrics::DEFINITION),
    (ComponentSample::TYPE, "/sdr/robot_1/components", ComponentSample::DEFINITION),
    (ConnectionSample::TYPE, "/sdr/robot_1/connections", ConnectionSample::DEFINITION),
    (OutputSample::TYPE, "/sdr/robot_1/outputs", OutputSample::DEFINITION),
    (EventSample::TYPE, "/sdr/robot_1/events", EventSample::DEFINITION),
    ("nav_msgs/msg/Odometry", "/exploration/position/odometry", ""),
    ("std_msgs/msg/Bool", "/exploration/anomaly/danger", ""),
];

/// A whole file of the messages that `choices` has: each a type, a time and a body.
pub fn file(choices: &mut Choices<'_>) -> Vec<u8> {
    let options = WriteOptions::new().profile("ros2").compression(None);
    let mut writer: Writer<_> = options.create(Cursor::new(Vec::new())).expect("memory");
    let mut channels = BTreeMap::new();
    for _ in 0..MESSAGES_MAX {
        if choices.is_empty() {
            break;
        }
        let kind = usize::from(choices.byte()) % TYPES.len();
        let channel_id = *channels.entry(kind).or_insert_with(|| {
            let (name, topic, definition) = TYPES[kind];
            let schema = writer.add_schema(name, "ros2msg", definition.as_bytes());
            let schema = schema.expect("few schemas");
            writer.add_channel(schema, topic, "cdr", &BTreeMap::new()).expect("few channels")
        });
        let log_time = u64::from(choices.short()) << (choices.byte() % 48);
        let header = MessageHeader { channel_id, sequence: 0, log_time, publish_time: log_time };
        writer.write_to_known_channel(&header, choices.slice()).expect("memory");
    }
    writer.finish().expect("memory");
    writer.into_inner().into_inner()
}
