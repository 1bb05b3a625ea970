//! `sdr role`: who holds the coordinator role, who follows, and why.

use std::collections::BTreeMap;

use sdr_core::api::{CandidateView, EventView, FitnessPartView, RoleView, StatusView};
use serde::Serialize;

use super::{
    table::Table,
    units::{NOTHING, clock, one_line, wrap},
};

/// When the holder took the role, and why.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
pub(crate) struct Taken {
    /// Wall time of the holder, ms since 1970.
    wall_ms: u64,
    /// In its own words.
    reason: String,
}

impl Taken {
    /// As the holder's own events say.
    pub(crate) fn of(events: &[EventView], role: &RoleView) -> Option<Self> {
        let holder = role.holder.as_ref()?;
        #[expect(clippy::cast_precision_loss, reason = "terms are small")]
        let term = role.term as f64;
        let said = events.iter().rev().find(|view| {
            let event = &view.event;
            event.kind == "role-taken"
                && event.robot.as_str() == holder
                && event.numbers.get("term") == Some(&term)
        })?;
        Some(Self { wall_ms: said.wall_ms, reason: said.event.reason.clone() })
    }
}

/// What is wrong first, then the holder, those who follow, and all who could.
pub(crate) fn screen(view: &StatusView, taken: Option<&Taken>, columns: usize) -> Vec<String> {
    let role = &view.role;
    let mut lines = Vec::new();
    let mut say = |text: &str| lines.extend(wrap(text, columns, "  "));
    if role.suspended {
        say(&format!("! {} hears nobody and decides nothing for others", view.seen_from));
        say("");
    }
    say(&head(view, taken));
    say(&format!("successors: {}", names(&role.successors)));
    if let Some(robot) = &role.offered_to {
        say(&format!("offered to {robot}: {}", one_line(&role.reason)));
    }
    say(&format!("policy: {}    show it: sdr role policy", one_line(&role.policy)));
    if !role.rules.forbidden.is_empty() {
        let robots: Vec<String> = role.rules.forbidden.iter().map(ToString::to_string).collect();
        say(&format!("never by this policy: {}", robots.join(", ")));
    }
    lines.push(String::new());
    lines.extend(candidates(role).lines(columns));
    lines.extend([String::new(), String::from("why: sdr role why")]);
    lines
}

fn head(view: &StatusView, taken: Option<&Taken>) -> String {
    let role = &view.role;
    let Some(holder) = &role.holder else {
        return format!("! nobody is known to hold the role      seen from {}", view.seen_from);
    };
    let by = if role.by_operator { ", named by an operator" } else { "" };
    let since = taken.map_or_else(String::new, |taken| {
        // the term stands before it already
        let term = format!("term {}, ", role.term);
        let reason = taken.reason.strip_prefix(&term).unwrap_or(&taken.reason);
        format!(", since {} ({})", clock(taken.wall_ms), one_line(reason))
    });
    format!("{holder} coordinates, term {}{by}{since}      seen from {}", role.term, view.seen_from)
}

fn names(robots: &[String]) -> String {
    match robots.is_empty() {
        true => String::from("none named"),
        false => robots.join(", "),
    }
}

fn candidates(role: &RoleView) -> Table<8> {
    let head = ["ROBOT", "POINTS", "BATTERY", "CPU", "MEMORY", "LINKS", "CENTRALITY", "NOTE"];
    let mut table = Table::new(head);
    for candidate in &role.candidates {
        let scores: BTreeMap<&str, u32> =
            candidate.parts.iter().map(|part| (part.aspect.as_str(), part.score)).collect();
        let score = |aspect: &str, width: usize| {
            let score = scores.get(aspect).map_or_else(|| NOTHING.into(), ToString::to_string);
            format!("{score:>width$}")
        };
        table.row([
            candidate.robot.clone(),
            format!("{:>6}", candidate.points),
            score("battery", 7),
            score("cpu", 4),
            score("memory", 6),
            score("links", 5),
            score("centrality", 10),
            note(role, candidate),
        ]);
    }
    table
}

fn note(role: &RoleView, candidate: &CandidateView) -> String {
    let mut notes = Vec::new();
    if role.holder.as_ref() == Some(&candidate.robot) {
        notes.push(String::from("coordinator"));
    }
    if candidate.preferred {
        notes.push(String::from("preferred"));
    }
    if let Some(unfit) = &candidate.unfit {
        notes.push(format!("unfit: {}", one_line(unfit)));
    }
    notes.join("; ")
}

/// The ranking in words.
pub(crate) fn ranking(view: &StatusView, columns: usize) -> Vec<String> {
    let role = &view.role;
    let mut lines = Vec::new();
    let mut say = |text: &str| lines.extend(wrap(text, columns, "     "));
    say(&format!(
        "By policy {}, as {} sees it: fit robots first, then preferred ones, then pinned ones in \
         their order, then more points (in steps of 50), then by name.",
        one_line(&role.policy),
        view.seen_from
    ));
    for (index, candidate) in role.candidates.iter().enumerate() {
        let held = role.holder.as_ref() == Some(&candidate.robot);
        let held = if held { ", coordinator" } else { "" };
        let preferred = match (candidate.preferred, pin(role, &candidate.robot)) {
            (_, Some(place)) => format!(", pinned as number {}", place + 1),
            (true, None) => String::from(", preferred by its robot.toml"),
            (false, None) => String::new(),
        };
        say("");
        say(&format!(
            "{}. {}: {} of 1000 points{held}{preferred}",
            index + 1,
            candidate.robot,
            candidate.points
        ));
        if let Some(unfit) = &candidate.unfit {
            say(&format!("   unfit: {}", one_line(unfit)));
        }
        say(&format!("   {}", sum(&candidate.parts)));
    }
    for robot in &role.rules.forbidden {
        say("");
        say(&format!("-  {robot}: never, by the policy"));
    }
    if role.candidates.is_empty() {
        say("No living robot may hold the role.");
    }
    say("");
    say(&moving(role));
    lines
}

fn pin(role: &RoleView, robot: &str) -> Option<usize> {
    role.rules.pinned.iter().position(|pinned| pinned.as_str() == robot)
}

/// `battery 900 x 2 + cpu 800 x 1 = 2600, by 3`.
fn sum(parts: &[FitnessPartView]) -> String {
    let counted: Vec<&FitnessPartView> = parts.iter().filter(|part| part.weight > 0).collect();
    let terms: Vec<String> = counted
        .iter()
        .map(|part| format!("{} {} x {}", one_line(&part.aspect), part.score, part.weight))
        .collect();
    let weight: u64 = counted.iter().map(|part| u64::from(part.weight)).sum();
    let sum: u64 = counted.iter().map(|part| u64::from(part.score) * u64::from(part.weight)).sum();
    match terms.is_empty() {
        true => String::from("nothing counts by this policy: all robots are alike"),
        false => format!("{} = {sum}, by {weight}", terms.join(" + ")),
    }
}

/// When the role would leave its holder.
fn moving(role: &RoleView) -> String {
    let rules = &role.rules;
    let seconds = rules.margin_for.as_secs_f64();
    match role.by_operator {
        true => String::from(
            "An operator named the holder: it gives the role up when it is unfit, not for points.",
        ),
        false => format!(
            "The role leaves a fit holder for one that is {} points ahead, or preferred, for {seconds} s.",
            rules.margin
        ),
    }
}

#[cfg(test)]
mod tests;
