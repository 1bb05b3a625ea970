//! What happened, in lines for people.

use sdr_core::{event::Event, time::Instant};

use super::{Fleet, fleet::BEGIN};

/// Everything that struck and everything brains said, in order.
pub fn story(fleet: &Fleet) -> Vec<String> {
    let struck = fleet.struck.iter().map(|(at, what)| (*at, format!("!! {what}")));
    let told = fleet.told.iter().map(|(at, robot, event)| (*at, line(*robot, event)));
    let mut all: Vec<(Instant, String)> = struck.chain(told).collect();
    all.sort_by_key(|(at, _)| *at);
    let seconds = |at: Instant| at.since(BEGIN).as_secs_f64();
    all.into_iter().map(|(at, text)| format!("{:8.3} {text}", seconds(at))).collect()
}

fn line(robot: usize, event: &Event) -> String {
    let component = event.component.as_ref().map(|name| format!(" {name}")).unwrap_or_default();
    let token = event.token.as_ref().map(|token| format!(" [{token}]")).unwrap_or_default();
    format!("robot-{} {}{component}{token}: {}", robot + 1, event.kind, event.reason)
}
