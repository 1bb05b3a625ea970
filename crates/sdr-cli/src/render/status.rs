//! `sdr status`: what is wrong first, then robots, then systems.

use sdr_core::api::{ComponentView, RobotView, StatusView, SystemView};

use super::{
    problems::Problem,
    table::Table,
    units::{NOTHING, count, level, megabytes, one_line, percent, span, wrap},
};

pub(crate) use super::problems::{is_active, problems};

/// The whole screen: `problems` of the view, to which more may have been learnt, stand first.
pub(crate) fn screen(view: &StatusView, problems: &[Problem], columns: usize) -> Vec<String> {
    let mut lines = Vec::new();
    for problem in problems {
        lines.extend(wrap(&format!("! {}", problem.text), columns, "  "));
        for detail in &problem.details {
            lines.extend(wrap(&format!("    {detail}"), columns, "      "));
        }
    }
    if !lines.is_empty() {
        lines.push(String::new());
    }
    lines.extend(wrap(&head(view), columns, "  "));
    lines.push(String::new());
    lines.extend(robots(view).lines(columns));
    for system in &view.systems {
        lines.push(String::new());
        lines.extend(wrap(&system_head(system), columns, "  "));
        lines.extend(components(system).lines(columns));
    }
    lines.extend(conditions(view, columns));
    lines.extend(next_step(view));
    lines
}

fn head(view: &StatusView) -> String {
    let role = match &view.coordinator {
        Some(robot) if *robot == view.seen_from => format!("coordinator, term {}", view.term),
        Some(robot) => format!("coordinator {robot}, term {}", view.term),
        None => "no coordinator known".into(),
    };
    format!(
        "{}, {}      seen from {}, {role}",
        count(view.robots.len(), "robot"),
        count(view.systems.len(), "system"),
        view.seen_from
    )
}

fn robots(view: &StatusView) -> Table<8> {
    let head = ["ROBOT", "SEEN", "CPU", "FREE MEM", "BATTERY", "RSSI", "ROLE", "NOTE"];
    let mut table = Table::new(head);
    for robot in &view.robots {
        let faint = robot.conditions.iter().any(|condition| condition.contains("rssi"));
        let seen = match (robot.name == view.seen_from, robot.alive) {
            (true, _) => "here".into(),
            (false, true) => span(robot.seen_ms),
            (false, false) => format!("{} !", span(robot.seen_ms)),
        };
        table.row([
            robot.name.clone(),
            seen,
            format!("{:>5}", percent(robot.cpu_permille)),
            format!("{:>8}", megabytes(robot.memory_free_bytes)),
            battery(robot),
            format!("{}{}", level(robot.rssi_dbm), if faint { " !" } else { "" }),
            if robot.coordinator { "coordinator".into() } else { NOTHING.into() },
            note(robot),
        ]);
    }
    table
}

fn battery(robot: &RobotView) -> String {
    robot.battery_permille.map_or_else(|| NOTHING.into(), percent)
}

fn note(robot: &RobotView) -> String {
    one_line(&robot.conditions.join("; "))
}

fn system_head(system: &SystemView) -> String {
    let active = system.components.iter().filter(|component| is_active(component)).count();
    let heard = system.connections.iter().filter(|connection| connection.heard).count();
    format!(
        "SYSTEM {}   revision {}   {active} of {} active   {heard} of {} connections heard",
        system.name,
        system.revision,
        system.components.len(),
        system.connections.len()
    )
}

fn components(system: &SystemView) -> Table<6> {
    let mut table = Table::new(["COMPONENT", "HOME", "STATE", "EPOCH", "MEMORY", "NOTE"]);
    for component in &system.components {
        table.row([
            component.name.clone(),
            component.home.clone().unwrap_or_else(|| NOTHING.into()),
            component.state.map_or_else(|| NOTHING.into(), |state| state.to_string()),
            component.epoch.to_string(),
            format!("{:>7}", megabytes(component.memory_bytes)),
            component_note(component),
        ]);
    }
    table
}

fn component_note(component: &ComponentView) -> String {
    let mut parts = Vec::new();
    if component.run > 1 {
        parts.push(format!("run {}", component.run));
    }
    if component.restarts > 0 {
        parts.push(count(usize::try_from(component.restarts).unwrap_or(usize::MAX), "restart"));
    }
    if !component.standbys.is_empty() {
        parts.push(format!("also on {}", component.standbys.join(", ")));
    }
    let reason = one_line(&component.reason);
    if !reason.is_empty() {
        parts.push(reason);
    }
    parts.join("; ")
}

/// Causes that hold on the answering robot, but not for long enough to be acted on.
fn conditions(view: &StatusView, columns: usize) -> Vec<String> {
    let mut lines = vec![String::new()];
    for condition in view.conditions.iter().filter(|condition| !condition.raised) {
        let line = format!(
            "{} of {} on {}, held {} of {}: {}",
            condition.cause,
            condition.component,
            view.seen_from,
            span(condition.held_ms),
            span(condition.hold_ms),
            one_line(&condition.reason)
        );
        lines.extend(wrap(&line, columns, "  "));
    }
    if lines.len() == 1 { Vec::new() } else { lines }
}

fn next_step(view: &StatusView) -> Vec<String> {
    let next = match view.systems.is_empty() {
        true => "Nothing is deployed.    next: sdr deploy systems/exploration.yaml --wait",
        false => "why: sdr events -n 20",
    };
    vec![String::new(), next.into()]
}

#[cfg(test)]
mod tests;
