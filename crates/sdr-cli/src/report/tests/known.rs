//! What a demo would know of the story beside its recordings.

use super::story::MS;
use crate::report::{
    extra::{Bars, Coordinator, Detector, Extra, Radio, TruthPoint},
    machine::Machine,
};

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
        machine: Some(Machine {
            commit: Some("0123abc".to_owned()),
            rustc: Some("rustc 1.95.0".to_owned()),
            ..Machine::here()
        }),
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
        pictures: None,
        danger_topic: Some("/exploration/anomaly/danger".to_owned()),
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
