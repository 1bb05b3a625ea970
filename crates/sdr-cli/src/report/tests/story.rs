//! The paper's run in small: five components, one move, one recording for each robot.

use std::{
    collections::BTreeMap,
    f64::consts::TAU,
    fs::File,
    io::BufWriter,
    path::{Path, PathBuf},
};

use byteorder::LittleEndian;
use mcap::{WriteOptions, Writer, records::MessageHeader};
use sdr_core::recording::{
    ComponentSample, ConnectionSample, EventSample, OutputSample, Recorded, RobotMetrics,
};
use serde::Serialize;

use crate::report::{
    extra::{Bars, Coordinator, Detector, Extra, Radio, TruthPoint},
    machine::Machine,
};

pub(crate) const MS: u64 = 1_000_000;
/// Log times are monotonic times and this.
const WALL_NS: u64 = 1_700_000_000_000_000_000;
const SYSTEM: &str = "exploration";
const ROBOTS: [&str; 3] = ["robot-1", "robot-2", "robot-3"];

/// Messages by robot, in any order.
#[derive(Default)]
pub(crate) struct Story {
    messages: BTreeMap<&'static str, Vec<Message>>,
}

struct Message {
    at_ns: u64,
    topic: String,
    type_name: &'static str,
    definition: &'static str,
    cdr: Vec<u8>,
}

/// What a demo would know of it.
pub(crate) fn extra() -> Extra {
    let truth = (0..600).map(|tick: u32| TruthPoint {
        monotonic_ns: u64::from(tick) * 50 * MS,
        x_m: 1.5 + f64::from(tick) * 0.015,
        y_m: -0.8,
    });
    // Every 20 ms, once 24 ms.
    let commands =
        (0..1400_u64).map(|tick| (1000 + tick * 20 + if tick > 1000 { 4 } else { 0 }) * MS);
    let names = |list: &[&str]| list.iter().map(|name| (*name).to_owned()).collect();
    Extra {
        ballast: Some(true),
        machine: Some(Machine::here()),
        radio: Some(Radio {
            robot: "robot-1".to_owned(),
            from_dbm: -47.0,
            to_dbm: -55.0,
            noise_db: 0.5,
            fade_s: 1.5,
            carrier: "loopback".to_owned(),
        }),
        bars: Some(Bars {
            allocation_memory_bytes: Some(500_000_000),
            relaxed_memory_bytes: Some(250_000_000),
            recovery_memory_bytes: Some(200_000_000),
            recovery_rssi_dbm: Some(-52.5),
            recovery_rssi_hold_s: Some(6.0),
        }),
        coordinator: Coordinator::default(),
        components: names(&["fisheye", "anomaly", "camera", "controller", "position"]),
        connections: names(&[
            "fisheye.image -> anomaly.image",
            "anomaly.danger -> controller.danger",
            "camera.image -> position.image",
            "position.odometry -> controller.odometry",
            "controller.wheels -> position.wheels",
        ]),
        until_ns: Some(26_000 * MS),
        position_topic: Some("/exploration/position/odometry".to_owned()),
        truth: truth.collect(),
        commands_ns: commands.collect(),
        detector: Some(Detector {
            shown: 1,
            stops: 1,
            stop_after_ms: Some(420.0),
            ..Detector::default()
        }),
        lab: None,
    }
}

impl Story {
    /// Robots without any system.
    pub(crate) fn bare() -> Self {
        let mut story = Self::default();
        for robot in ROBOTS {
            let metrics = RobotMetrics { rssi_dbm: f32::NAN, ..metrics(robot, 1000, 1900) };
            story.add(robot, 1000, &metrics);
        }
        story
    }

    /// Deployed at 1 s, active at 1.9 s, in trouble from 21 s, moved by 21.4 s.
    pub(crate) fn whole() -> Self {
        let mut story = Self::default();
        for (index, robot) in ROBOTS.into_iter().enumerate() {
            for tick in 0..130 {
                let at_ms = tick * 200;
                let free = free_mb(index, at_ms);
                let mut metrics = metrics(robot, at_ms, free);
                let wobble = (f64::from(u32::try_from(tick).unwrap()) * 0.7).sin() * 0.5;
                let level = if index == 0 { fading(at_ms) } else { -47.0 };
                metrics.rssi_dbm = f64_to_f32(level + wobble);
                story.add(robot, at_ms, &metrics);
            }
        }
        story.events();
        story.instances();
        story.connections();
        for tick in 0..100_u64 {
            story.odometry(2000 + tick * 100);
        }
        story
    }

    /// Writes `<robot>.mcap` for each robot.
    pub(crate) fn write(mut self, folder: &Path) -> Vec<PathBuf> {
        let mut files = Vec::new();
        for (robot, messages) in &mut self.messages {
            messages.sort_by_key(|message| message.at_ns);
            let path = folder.join(format!("{robot}.mcap"));
            let file = BufWriter::new(File::create(&path).unwrap());
            let mut writer: Writer<_> =
                WriteOptions::new().profile("ros2").compression(None).create(file).unwrap();
            let mut channels = BTreeMap::new();
            for message in messages {
                let channel_id = *channels.entry(message.topic.clone()).or_insert_with(|| {
                    let definition = message.definition.as_bytes();
                    let schema =
                        writer.add_schema(message.type_name, "ros2msg", definition).unwrap();
                    writer.add_channel(schema, &message.topic, "cdr", &BTreeMap::new()).unwrap()
                });
                let log_time = WALL_NS + message.at_ns;
                let header =
                    MessageHeader { channel_id, sequence: 0, log_time, publish_time: log_time };
                writer.write_to_known_channel(&header, &message.cdr).unwrap();
            }
            writer.finish().unwrap();
            files.push(path);
        }
        files
    }

    fn add<T: Recorded + Serialize>(&mut self, robot: &'static str, at_ms: u64, message: &T) {
        self.messages.entry(robot).or_default().push(Message {
            at_ns: at_ms * MS,
            topic: format!("/sdr/{}/{}", robot.replace('-', "_"), T::TOPIC),
            type_name: T::TYPE,
            definition: T::DEFINITION,
            cdr: cdr(message),
        });
    }

    fn events(&mut self) {
        let event =
            |at_ms: u64, robot: &str, kind: &str, component: &str, reason: &str| EventSample {
                monotonic_ns: at_ms * MS,
                kind: kind.to_owned(),
                robot: robot.to_owned(),
                system: SYSTEM.to_owned(),
                component: component.to_owned(),
                reason: reason.to_owned(),
                ..EventSample::default()
            };
        self.add("robot-2", 500, &event(500, "robot-2", "role-taken", "", "fittest of 3"));
        self.add("robot-1", 1000, &event(1000, "robot-1", "deployed", "", "5 components"));
        for (component, reason) in [
            ("fisheye", "first that fits"),
            ("anomaly", "first that fits"),
            ("camera", "robot-1 310 MB, bar 500 MB"),
            ("controller", "robot-1 310 MB, bar 500 MB"),
            ("position", "robot-1 310 MB, robot-2 310 MB, bar 500 MB"),
        ] {
            let mut placed = event(1010, "robot-2", "placed", component, reason);
            placed.number_names.push("memory_left_bytes".to_owned());
            placed.number_values.push(840e6);
            self.add("robot-2", 1010, &placed);
        }
        let words = "rssi-low: median -54.9 dBm, bar -52.5 dBm, held 6.0 s";
        let mut raised = event(21_000, "robot-1", "condition-raised", "", words);
        raised.number_names.push("held_over_ns".to_owned());
        raised.number_values.push(20_980e6);
        self.add("robot-1", 21_000, &raised);
        let label = "anomaly.danger -> controller.danger";
        let mut heard = event(21_380, "robot-2", "heard", "controller", label);
        heard.epoch = 2;
        self.add("robot-2", 21_380, &heard);
        for component in ["fisheye", "anomaly"] {
            let words = "robot-3: 310 MB left, recovery bar 250 MB";
            self.add("robot-2", 21_050, &event(21_050, "robot-2", "placed", component, words));
            self.add(
                "robot-2",
                21_060,
                &event(21_060, "robot-2", "move-started", component, "rssi-low"),
            );
            self.add("robot-2", 21_400, &event(21_400, "robot-2", "moved", component, "heard"));
        }
    }

    fn instances(&mut self) {
        let plan = [
            ("fisheye", "robot-1"),
            ("anomaly", "robot-1"),
            ("camera", "robot-2"),
            ("controller", "robot-2"),
            ("position", "robot-3"),
        ];
        for (index, (component, robot)) in plan.into_iter().enumerate() {
            let offset = u64::try_from(index).unwrap() * 50;
            self.state(robot, component, 1100, "created", 0);
            self.state(robot, component, 1200 + offset, "inactive", 0);
            let ends = if robot == "robot-1" { 21_500 } else { 26_000 };
            for at_ms in (1500 + offset..ends).step_by(1000) {
                self.state(robot, component, at_ms, "active", 1);
            }
        }
        for component in ["fisheye", "anomaly"] {
            self.state("robot-3", component, 21_100, "inactive", 0);
            for at_ms in (21_250..26_000).step_by(1000) {
                self.state("robot-3", component, at_ms, "active", 2);
            }
            self.state("robot-1", component, 21_450, "inactive", 1);
            self.state("robot-1", component, 21_600, "ended", 0);
        }
    }

    fn state(&mut self, robot: &'static str, component: &str, at_ms: u64, state: &str, epoch: u64) {
        let sample = ComponentSample {
            monotonic_ns: at_ms * MS,
            robot: robot.to_owned(),
            system: SYSTEM.to_owned(),
            component: component.to_owned(),
            state: state.to_owned(),
            epoch,
            run: 1,
            memory_bytes: 530_000_000,
            ..ComponentSample::default()
        };
        self.add(robot, at_ms, &sample);
    }

    fn connections(&mut self) {
        for (name, robot) in [
            ("anomaly.danger -> controller.danger", "robot-2"),
            ("camera.image -> position.image", "robot-3"),
            ("position.odometry -> controller.odometry", "robot-2"),
            ("controller.wheels -> position.wheels", "robot-3"),
        ] {
            let first = if name.starts_with("anomaly") { 1900 } else { 1700 };
            for at_ms in (2000..26_000).step_by(200) {
                let epoch = if name.starts_with("anomaly") && at_ms >= 21_400 { 2 } else { 1 };
                let mut window = window(robot, name, at_ms, first);
                window.epoch = epoch;
                window.accepted = 1 + (at_ms - 2000) * 269 / 23_800;
                window.lost = u64::from(at_ms >= 21_400 && name.starts_with("anomaly"));
                self.add(robot, at_ms, &window);
            }
        }
        let name = "fisheye.image -> anomaly.image";
        for at_ms in (2000..=21_200).step_by(200) {
            self.add("robot-1", at_ms, &window("robot-1", name, at_ms, 1800));
        }
        for at_ms in (21_400..26_000).step_by(200) {
            let mut window = window("robot-3", name, at_ms, 21_300);
            window.epoch = 2;
            self.add("robot-3", at_ms, &window);
        }
        for (robot, sent) in [("robot-1", 300), ("robot-3", 100)] {
            let sample = OutputSample {
                monotonic_ns: 25_000 * MS,
                robot: robot.to_owned(),
                system: SYSTEM.to_owned(),
                output: "fisheye.image".to_owned(),
                sent,
                ..OutputSample::default()
            };
            self.add(robot, 25_000, &sample);
        }
    }

    fn odometry(&mut self, at_ms: u64) {
        let x = 1.5 + super::run::seconds(at_ms * MS) * 0.3;
        // Header, child frame, place, turn; covariances and the twist follow in a real one.
        let head = (
            (1_i32, 2_u32),
            "map",
            "base",
            (x, -0.7_f64, 0.0_f64),
            (0.0_f64, 0.0_f64, 0.0_f64, 1.0_f64),
        );
        self.messages.entry("robot-3").or_default().push(Message {
            at_ns: at_ms * MS,
            topic: "/exploration/position/odometry".to_owned(),
            type_name: "nav_msgs/msg/Odometry",
            definition: "",
            cdr: cdr(&head),
        });
    }
}

fn cdr<T: Serialize>(message: &T) -> Vec<u8> {
    let mut bytes = vec![0, 1, 0, 0];
    bytes.extend(cdr_encoding::to_vec::<T, LittleEndian>(message).unwrap());
    bytes
}

fn metrics(robot: &str, at_ms: u64, free_mb: u64) -> RobotMetrics {
    RobotMetrics {
        monotonic_ns: at_ms * MS,
        robot: robot.to_owned(),
        memory_capacity_bytes: 1_900_000_000,
        memory_free_bytes: free_mb * 1_000_000,
        battery_percent: 80.0,
        rssi_dbm: -47.0,
        agent_rss_bytes: 15_000_000,
        agent_pss_bytes: 9_000_000,
        agent_cpu_permille: 7,
        ..RobotMetrics::default()
    }
}

fn window(robot: &str, name: &str, at_ms: u64, first_ms: u64) -> ConnectionSample {
    ConnectionSample {
        monotonic_ns: at_ms * MS,
        robot: robot.to_owned(),
        system: SYSTEM.to_owned(),
        connection: name.to_owned(),
        accepted: 100,
        first_ns: first_ms * MS,
        last_ns: (at_ms - if at_ms < 21_300 { 5 } else { 10 }) * MS,
        gap_max_ns: 67 * MS,
        period_median_ns: 66 * MS,
        epoch: 1,
        ..ConnectionSample::default()
    }
}

fn free_mb(robot: usize, at_ms: u64) -> u64 {
    match (robot, at_ms) {
        (_, ..1400) => 1895,
        (0 | 1, ..21_600) | (1, _) => 838,
        (0, _) => 1893,
        (_, ..21_300) => 1366,
        _ => 309,
    }
}

fn fading(at_ms: u64) -> f64 {
    let share = super::run::seconds(at_ms.saturating_sub(13_500) * MS) / 1.5;
    -47.0 - 8.0 * share.clamp(0.0, 1.0) + 0.1 * (share * TAU).sin()
}

#[expect(clippy::cast_possible_truncation, reason = "recordings hold single precision")]
fn f64_to_f32(value: f64) -> f32 {
    value as f32
}
