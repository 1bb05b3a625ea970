//! A scenario of the lab: what was expected, what was found, and what was done when.

use super::{section, table};
use crate::report::Report;

/// Expectations and timeline; nothing when it was no scenario.
pub(super) fn scenario(report: &Report) -> String {
    let Some(lab) = &report.extra.lab else { return String::new() };
    let rows: Vec<Vec<String>> = lab
        .expectations
        .iter()
        .map(|one| {
            let took = one.took_ms.map(|ms| format!("{:.2} s", ms / 1000.0));
            vec![
                if one.met { "met".to_owned() } else { "MISSED".to_owned() },
                one.expected.clone(),
                took.unwrap_or_default(),
                one.found.clone(),
                one.line.to_string(),
            ]
        })
        .collect();
    let about = format!(
        "<p class=\"muted\">{} (seed {})</p>\n",
        super::super::svg::escape(&lab.about),
        lab.seed
    );
    let expectations = table(&["", "expected", ">after", "found", ">line"], &rows);
    let told: Vec<Vec<String>> =
        lab.timeline.iter().map(|one| vec![format!("{:.2}", one.at_s), one.text.clone()]).collect();
    let timeline = table(&[">second", "what happened"], &told);
    let heading = format!("Scenario {}", lab.scenario);
    section(&heading, &(about + &expectations)) + &section("Timeline", &timeline)
}
