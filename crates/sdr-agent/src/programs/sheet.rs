//! The facts that a program is told, as docs/recovery.md describes them.

use sdr_core::{
    id::{Name, RobotId},
    recover::{Evidence, RobotEvidence, Spread},
    units::Permille,
};
use serde_json::{Value, json};

/// Version of the sheet: raised when a field changes its meaning; fields may be added.
const SHEET_VERSION: u32 = 1;

pub(super) fn sheet(robot: &RobotId, system: &Name, evidence: &[Evidence]) -> Value {
    let components: Vec<Value> = evidence.iter().map(component).collect();
    let here = evidence.first().map(|one| one.robot).unwrap_or_default();
    json!({
        "v": SHEET_VERSION,
        "system": system,
        "robot": {
            "name": robot,
            "memory_free_bytes": here.memory_free.map(|bytes| bytes.0),
            "cpu": here.cpu.map(share),
            "battery": here.battery.map(share),
            "rssi_dbm": here.rssi.map(|rssi| f64::from(rssi.tenths()) / 10.0),
        },
        "components": components,
    })
}

fn component(seen: &Evidence) -> Value {
    json!({
        "name": seen.component.name,
        "actuator": seen.actuator,
        "standby_here": seen.standby_here,
        "standby_elsewhere": seen.standby_elsewhere,
        "memory_bytes": seen.memory.0,
        "cpu": share(seen.cpu),
        "cpu_limit": share(seen.cpu_limit),
        "deadlines_missed": seen.deadlines_missed,
        "inputs_late": seen.inputs_late,
        "links": links(&seen.robot),
    })
}

fn links(robot: &RobotEvidence) -> Value {
    let seconds = |spread: Spread<std::time::Duration>| {
        spread_of(
            spread.best.as_secs_f64(),
            spread.median.as_secs_f64(),
            spread.worst.as_secs_f64(),
        )
    };
    let shares = |spread: Spread<Permille>| {
        spread_of(share(spread.best), share(spread.median), share(spread.worst))
    };
    json!({
        "delay_s": robot.delay.map(seconds),
        "jitter_s": robot.jitter.map(seconds),
        "loss": robot.loss.map(shares),
    })
}

fn spread_of(best: f64, median: f64, worst: f64) -> Value {
    json!({ "best": best, "median": median, "worst": worst })
}

fn share(permille: Permille) -> f64 {
    f64::from(permille.0) / 1000.0
}
