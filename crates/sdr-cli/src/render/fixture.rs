//! Views for tests: the paper's fleet after its move.

use sdr_core::{
    allocate::Refusal,
    api::{ComponentView, ConnectionView, RobotView, StatusView, SystemView},
    id::RobotId,
    lifecycle::LifecycleState,
};

/// Three robots, robot-2 answering and coordinating.
pub(crate) fn fleet() -> StatusView {
    StatusView {
        seen_from: "robot-2".into(),
        coordinator: Some("robot-2".into()),
        term: 1,
        role: sdr_core::api::RoleView::default(),
        robots: vec![
            robot("robot-1", 1_898_000_000, -55.0),
            robot("robot-2", 841_000_000, -47.1),
            robot("robot-3", 312_000_000, -46.8),
        ],
        systems: vec![exploration()],
        conditions: Vec::new(),
    }
}

/// The five components and their connections, all well.
pub(crate) fn exploration() -> SystemView {
    let homes = [
        ("fisheye", "robot-3", 2, "moved from robot-1: rssi-low"),
        ("anomaly", "robot-3", 2, "moved from robot-1: rssi-low"),
        ("camera", "robot-2", 1, "robot-1: memory_free 310 MB, bar 500 MB"),
        ("controller", "robot-2", 1, "robot-1: memory_free 310 MB, bar 500 MB"),
        ("position", "robot-3", 1, "robot-2: memory_free 310 MB, bar 500 MB"),
    ];
    let lines = [
        "fisheye.image -> anomaly.image",
        "anomaly.danger -> controller.danger",
        "camera.image -> position.image",
        "position.odometry -> controller.odometry",
        "controller.wheels -> position.wheels",
    ];
    SystemView {
        name: "exploration".into(),
        revision: 1,
        components: homes.map(|(name, home, epoch, why)| component(name, home, epoch, why)).into(),
        connections: lines
            .map(|name| ConnectionView { name: name.into(), heard: true, remote: false })
            .into(),
    }
}

fn robot(name: &str, memory_free_bytes: u64, rssi_dbm: f64) -> RobotView {
    RobotView {
        name: name.into(),
        alive: true,
        seen_ms: if name == "robot-2" { 0 } else { 300 },
        coordinator: name == "robot-2",
        cpu_permille: 384,
        memory_free_bytes,
        memory_capacity_bytes: 1_900_000_000,
        battery_permille: Some(810),
        rssi_dbm: Some(rssi_dbm),
        rtt_ms: None,
        api: format!("/tmp/fleet/{name}.sock"),
        conditions: match name {
            "robot-1" => vec!["rssi-low 14 s".into()],
            _ => Vec::new(),
        },
    }
}

fn component(name: &str, home: &str, epoch: u64, reason: &str) -> ComponentView {
    ComponentView {
        name: name.into(),
        home: Some(home.into()),
        state: Some(LifecycleState::Active),
        epoch,
        epoch_minted_by: Some("robot-2".into()),
        run: 1,
        restarts: 0,
        memory_bytes: 530_000_000,
        cpu_permille: 120,
        standbys: Vec::new(),
        reason: reason.into(),
        refusals: Vec::new(),
    }
}

/// `component` without a home, refused by two robots.
pub(crate) fn make_homeless(component: &mut ComponentView) {
    component.home = None;
    component.state = None;
    component.epoch = 0;
    component.reason = "no robot fits".into();
    component.refusals = ["robot-1", "robot-2"]
        .map(|robot| Refusal {
            robot: RobotId::new(robot).unwrap(),
            constraint: "memory_free".into(),
            found: "310 MB".into(),
            bar: "500 MB".into(),
        })
        .into();
}
