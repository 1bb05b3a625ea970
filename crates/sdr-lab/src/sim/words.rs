//! Faults in words.

use std::{fmt, time::Duration};

use sdr_core::spec::{IsolationAction, Standby, SystemSpec};

use super::{Behaviour, ClockFate, DiskFate, Fault, Way};

impl fmt::Display for Fault {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&words(self))
    }
}

fn words(fault: &Fault) -> String {
    match fault {
        Fault::Crash { robot, down, disk } => crash(*robot, *down, *disk),
        Fault::CrashAtStore { robot, down } => {
            format!("{} loses power in its next write, back after {}", name(*robot), seconds(*down))
        }
        Fault::Pause { robot, time, clock } => {
            let what = match clock {
                ClockFate::Runs => "agent stands",
                ClockFate::Sleeps => "agent and clock stand",
            };
            format!("{}: {what} still for {}", name(*robot), seconds(*time))
        }
        Fault::Deaf { robot, time } => format!("{} is deaf for {}", name(*robot), seconds(*time)),
        Fault::Storm { loss, time } => {
            format!("{:.0} % of all datagrams are lost for {}", loss * 100.0, seconds(*time))
        }
        Fault::Cut { inside, way, time } => {
            let inside: Vec<String> = inside.iter().map(|robot| name(*robot)).collect();
            let way = match way {
                Way::Both => "cut off",
                Way::Out => "not heard by the others",
            };
            format!("{} {way} for {}", inside.join(", "), seconds(*time))
        }
        Fault::CutOffCoordinator { time } => {
            format!("the coordinator is cut off for {}", seconds(*time))
        }
        Fault::DiskFull { robot, time } => {
            format!("{}: disk full for {}", name(*robot), seconds(*time))
        }
        Fault::DiskSlow { robot, each, time } => {
            let each = each.as_millis();
            format!("{}: each write takes {each} ms, for {}", name(*robot), seconds(*time))
        }
        Fault::Exit { component } => format!("all processes of {component} are killed"),
        Fault::Hang { component } => format!("all processes of {component} hang"),
        Fault::Behave { robot, component, behaviour, time } => {
            let ways = ways(behaviour);
            format!("{component} on {} for {}: {ways}", name(*robot), seconds(*time))
        }
        Fault::Fade { robot, level_dbm, time } => {
            format!("{} measures {level_dbm} dBm for {}", name(*robot), seconds(*time))
        }
        Fault::Deploy { robot, system } => deployed(*robot, system),
        Fault::Undeploy { robot, system } => {
            format!("{} is told to undeploy {system}", name(*robot))
        }
        Fault::MoveRole { robot, to } => {
            format!("{} is told to give the role to {}", name(*robot), name(*to))
        }
        Fault::RolePolicy { robot, policy } => {
            format!("{} is told to choose holders by `{}`", name(*robot), policy.name)
        }
    }
}

fn deployed(robot: usize, system: &SystemSpec) -> String {
    let mut text = format!(
        "{} is told to deploy {}, {} components",
        name(robot),
        system.name,
        system.components.len()
    );
    let policies = [("allocation", &system.allocation), ("recovery", &system.recovery)];
    for (what, policy) in policies {
        if !policy.bytes.is_empty() {
            text.push_str(&format!(", {what} `{}`", policy.name));
        }
    }
    let leased = system.components.iter().map(|component| component.on_isolation);
    let leased = leased.filter(|isolation| isolation.action == IsolationAction::Deactivate);
    if let Some(lease) = leased.map(|isolation| isolation.after).max() {
        text.push_str(&format!(", leases of {}", seconds(lease)));
    }
    for component in system.components.iter().filter(|component| component.standby.count > 0) {
        let Standby { count, place, kind, .. } = &component.standby;
        text.push_str(&format!(", {count} {kind:?} {place:?} for {}", component.name));
    }
    text
}

fn crash(robot: usize, down: Option<Duration>, disk: DiskFate) -> String {
    let disk = match disk {
        DiskFate::Kept => "disk kept",
        DiskFate::Lost => "disk lost",
    };
    let back = match down {
        Some(down) => format!("back after {}", seconds(down)),
        None => "for good".into(),
    };
    format!("{} loses power, {disk}, {back}", name(robot))
}

fn ways(behaviour: &Behaviour) -> String {
    let mut ways = Vec::new();
    if behaviour.unstartable {
        ways.push("cannot be started".into());
    }
    if let Some(after) = behaviour.crash_after {
        ways.push(format!("ends {} ms after it became active", after.as_millis()));
    }
    if let Some((after, cause)) = behaviour.fail_after {
        ways.push(format!("{cause} {} ms after it became active", after.as_millis()));
    }
    ways.push(format!("comes up in {} ms", behaviour.initialise.as_millis()));
    ways.join(", ")
}

fn seconds(time: Duration) -> String {
    format!("{:.1} s", time.as_secs_f64())
}

fn name(robot: usize) -> String {
    format!("robot-{}", robot + 1)
}
