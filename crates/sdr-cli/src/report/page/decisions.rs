//! What was decided and why, in the agents' own words.

use sdr_core::recording::EventSample;

use super::{section, table};
use crate::report::Report;

/// Kinds that tell how the deployment came about.
const ALLOCATION: [&str; 6] =
    ["role-taken", "deployed", "planned", "plan-failed", "placed", "homeless"];
/// Kinds that tell how trouble was met.
const RECOVERY: [&str; 24] = [
    "condition-raised",
    "condition-cleared",
    "robot-gone",
    "robot-alive",
    "exited",
    "hung",
    "error",
    "restart",
    "role-taken",
    "planned",
    "plan-failed",
    "placed",
    "homeless",
    "move-foreseen",
    "move-called-off",
    "move-started",
    "move-prepared",
    "move-failed",
    "active",
    "heard",
    "fenced",
    "moved",
    "drained",
    "held",
];
/// Most rows of the list of all events.
const EVENTS_MAX: usize = 5000;

/// Who went where at the deployment, and why.
pub(super) fn allocation(report: &Report) -> String {
    let until = report.figures.trouble_ns.unwrap_or(u64::MAX);
    let events = events(report, &ALLOCATION, |event| event.monotonic_ns < until);
    section("The allocation's reasons", &list(report, &events))
}

/// What happened from the first sign of trouble on.
pub(super) fn recovery(report: &Report) -> String {
    let first = first_sign(report);
    let Some(from) = first else {
        return section(
            "The recovery's reasons",
            "<p class=\"muted\">Nothing was to be recovered.</p>\n",
        );
    };
    let events = events(report, &RECOVERY, |event| event.monotonic_ns >= from);
    section("The recovery's reasons", &list(report, &events))
}

/// Every event, folded away.
pub(super) fn all_events(report: &Report) -> String {
    let all: Vec<&EventSample> = report.run.events.iter().take(EVENTS_MAX).collect();
    let left_out = report.run.events.len() - all.len();
    let rest = if left_out > 0 {
        format!("<p>{left_out} later ones are left out.</p>\n")
    } else {
        String::new()
    };
    let body = format!(
        "<details><summary>{} events</summary>\n{}{rest}</details>\n",
        report.run.events.len(),
        list(report, &all)
    );
    section("All events", &body)
}

/// When the first trouble showed that did not come from the deployment itself.
fn first_sign(report: &Report) -> Option<u64> {
    let kinds = ["condition-raised", "robot-gone", "exited", "move-started"];
    let signs = report.run.events.iter().filter(|event| kinds.contains(&event.kind.as_str()));
    let first = signs.map(|event| event.monotonic_ns).min();
    match (first, report.figures.trouble_ns) {
        (Some(first), Some(trouble)) => Some(first.min(trouble)),
        (first, trouble) => first.or(trouble),
    }
}

fn events<'a>(
    report: &'a Report,
    kinds: &[&str],
    keep: impl Fn(&EventSample) -> bool,
) -> Vec<&'a EventSample> {
    report
        .run
        .events
        .iter()
        .filter(|event| kinds.contains(&event.kind.as_str()) && keep(event))
        .collect()
}

fn list(report: &Report, events: &[&EventSample]) -> String {
    if events.is_empty() {
        return "<p class=\"muted\">No event was recorded.</p>\n".to_owned();
    }
    let rows: Vec<Vec<String>> = events
        .iter()
        .map(|event| {
            let about = if event.component.is_empty() {
                event.system.clone()
            } else {
                report.run.name(&event.system, &event.component)
            };
            let token = match (event.epoch, event.run) {
                (0, _) => String::new(),
                (epoch, 0) => epoch.to_string(),
                (epoch, run) => format!("{epoch}.{run}"),
            };
            vec![
                format!("{:.3}", report.run.second(event.monotonic_ns)),
                event.robot.clone(),
                event.kind.clone(),
                about,
                token,
                why(event),
            ]
        })
        .collect();
    table(&[">s", "Said by", "What", "About", "Epoch", "Why"], &rows)
}

/// The reason, and the figures beside it.
fn why(event: &EventSample) -> String {
    let numbers = event.number_names.iter().zip(&event.number_values);
    let numbers = numbers.filter(|(name, _)| !name.ends_with("_ns") && *name != "cause");
    let numbers: Vec<String> =
        numbers.map(|(name, value)| format!("{name} {}", plain(name, *value))).collect();
    match (event.reason.is_empty(), numbers.is_empty()) {
        (_, true) => event.reason.clone(),
        (true, false) => numbers.join(", "),
        (false, false) => format!("{} ({})", event.reason, numbers.join(", ")),
    }
}

/// Bytes as megabytes, others with as many decimals as they need. Moments of the machine's clock
/// say nothing to people.
fn plain(name: &str, value: f64) -> String {
    if name.ends_with("_bytes") && value.abs() >= 1e6 {
        return format!("{:.0} MB", value / 1e6);
    }
    if (value - value.round()).abs() < 1e-9 { format!("{value:.0}") } else { format!("{value:.1}") }
}
