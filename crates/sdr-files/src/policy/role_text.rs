//! A policy of the coordinator role as a file: what `load_role` reads back as the same.

use std::time::Duration;

use sdr_core::{
    fitness::{Alone, RolePolicy},
    id::RobotId,
    units::{Dbm, Permille},
};

/// Words that YAML takes for something else than text.
const NO_TEXT: [&str; 9] = ["true", "false", "null", "yes", "no", "on", "off", "y", "n"];

/// The policy as a file.
pub fn role_text(policy: &RolePolicy) -> String {
    let (weights, bars) = (&policy.weights, &policy.bars);
    let alone = match policy.alone {
        Alone::Promote => "promote",
        Alone::Wait => "wait",
    };
    let lines = [
        format!("role: {}", word(&policy.name)),
        String::from("weights:"),
        format!("  battery: {}", weights.battery),
        format!("  cpu: {}", weights.cpu),
        format!("  memory: {}", weights.memory),
        format!("  links: {}", weights.links),
        format!("  centrality: {}", weights.centrality),
        String::from("bars:"),
        format!("  battery: {}", bar("at_least", bars.battery_min.map(share))),
        format!("  cpu_used: {}", bar("at_most", bars.cpu_max.map(share))),
        format!("  memory_free: {}", bar("at_least", bars.memory_min.map(share))),
        format!("  rssi: {}", bar("at_least", bars.rssi_min.map(level))),
        format!("  loss: {}", bar("at_most", bars.loss_max.map(share))),
        format!("pinned: {}", robots(&policy.pinned)),
        format!("forbidden: {}", robots(&policy.forbidden)),
        format!("margin: {}", policy.margin),
        format!("margin_for: {}", time(policy.margin_for)),
        format!("beat: {}", time(policy.beat)),
        format!("misses: {}", policy.misses),
        format!("stagger: {}", time(policy.stagger)),
        format!("alone: {alone}"),
    ];
    lines.join("\n") + "\n"
}

/// Bare where YAML reads it back as the same text, else in quotes.
fn word(text: &str) -> String {
    let plain =
        |byte: u8| byte.is_ascii_lowercase() || byte.is_ascii_digit() || b"-_".contains(&byte);
    let begins = text.starts_with(|first: char| first.is_ascii_lowercase());
    match begins && text.bytes().all(plain) && !NO_TEXT.contains(&text) {
        true => text.to_owned(),
        false => serde_json::Value::from(text).to_string(),
    }
}

fn robots(robots: &[RobotId]) -> String {
    let words: Vec<String> = robots.iter().map(|robot| word(robot.as_str())).collect();
    format!("[{}]", words.join(", "))
}

fn bar(edge: &str, bar: Option<String>) -> String {
    bar.map_or_else(|| String::from("none"), |bar| format!("{{ {edge}: {bar} }}"))
}

fn share(share: Permille) -> String {
    match share.0 % 10 {
        0 => format!("{}%", share.0 / 10),
        tenth => format!("{}.{tenth}%", share.0 / 10),
    }
}

fn level(level: Dbm) -> String {
    let (sign, tenths) = (if level.tenths() < 0 { "-" } else { "" }, level.tenths().unsigned_abs());
    match tenths % 10 {
        0 => format!("{sign}{}dBm", tenths / 10),
        tenth => format!("{sign}{}.{tenth}dBm", tenths / 10),
    }
}

/// In the largest unit that needs no fraction.
fn time(time: Duration) -> String {
    let nanoseconds = time.as_nanos();
    let units = [("s", 1_000_000_000), ("ms", 1_000_000), ("us", 1_000)];
    let whole = units.into_iter().find(|(_, size)| nanoseconds.is_multiple_of(*size));
    let (unit, size) = whole.unwrap_or(("ns", 1));
    format!("{}{unit}", nanoseconds / size)
}
