//! `report.html`: one file, nothing from outside, readable in light and in dark.

mod decisions;
mod lab;
mod plots;
mod structure;
mod tables;

use std::fmt::Write as _;

use super::{Report, svg::escape};

/// The paper's figures on three Raspberry Pi 4 with real Wi-Fi, seconds.
pub(crate) const PAPER_ACTIVATION_S: u32 = 16;
/// The same for the move of two components.
pub(crate) const PAPER_RECOVERY_S: u32 = 11;
/// What has to be said beside a comparison with them.
pub(crate) const CAVEAT: &str =
    "This machine is not a Raspberry Pi and loopback is not Wi-Fi: the comparison is no race.";

/// The page of a report.
pub(crate) fn page(report: &Report) -> String {
    let mut html = String::with_capacity(256 << 10);
    let title = title(report);
    html.push_str("<!doctype html>\n<html lang=\"en\">\n<head>\n<meta charset=\"utf-8\">\n");
    html.push_str("<meta name=\"viewport\" content=\"width=device-width, initial-scale=1\">\n");
    let _ = writeln!(html, "<title>{}</title>", escape(&title));
    let _ = writeln!(html, "<style>\n{}</style>\n</head>\n<body>", include_str!("style.css"));
    let _ = writeln!(html, "<h1>{}</h1>", escape(&title));
    let _ = writeln!(html, "<p class=\"muted\">{}</p>", escape(&subtitle(report)));
    html.push_str(&tables::headline(report));
    html.push_str(&lab::scenario(report));
    html.push_str(&structure::before_and_after(report));
    html.push_str(&plots::robots(report));
    html.push_str(&decisions::allocation(report));
    html.push_str(&decisions::recovery(report));
    html.push_str(&tables::environment(report));
    html.push_str(&tables::connections(report));
    html.push_str(&tables::agents(report));
    html.push_str(&decisions::all_events(report));
    html.push_str(&tables::files(report));
    html.push_str("</body>\n</html>\n");
    html
}

fn title(report: &Report) -> String {
    let systems: Vec<&str> = report.run.systems.iter().map(String::as_str).collect();
    if systems.is_empty() { "A fleet".to_owned() } else { systems.join(", ") }
}

fn subtitle(report: &Report) -> String {
    let run = &report.run;
    let count = |number: usize, noun: &str| crate::render::units::count(number, noun);
    let ballast = match report.extra.ballast {
        Some(true) => "; each component allocates and touches 500 MB",
        Some(false) => "; without ballast",
        None => "",
    };
    format!(
        "{}, {}, {}, {:.1} s recorded{ballast}.",
        count(run.robots.len(), "robot"),
        count(run.components.len(), "component"),
        count(report.figures.moves.len(), "move"),
        run.second(run.until_ns)
    )
}

/// A section with its heading.
fn section(heading: &str, body: &str) -> String {
    format!("<h2>{}</h2>\n{body}", escape(heading))
}

/// A table; columns named with `>` before the name hold numbers.
fn table(head: &[&str], rows: &[Vec<String>]) -> String {
    let mut html = String::from("<div class=\"scroll\"><table>\n<tr>");
    for name in head {
        let _ = match name.strip_prefix('>') {
            Some(name) => write!(html, "<th class=\"number\">{}</th>", escape(name)),
            None => write!(html, "<th>{}</th>", escape(name)),
        };
    }
    html.push_str("</tr>\n");
    for row in rows {
        html.push_str("<tr>");
        for (index, cell) in row.iter().enumerate() {
            let number = head.get(index).is_some_and(|name| name.starts_with('>'));
            let class = if number { " class=\"number\"" } else { "" };
            let _ = write!(html, "<td{class}>{}</td>", escape(cell));
        }
        html.push_str("</tr>\n");
    }
    html.push_str("</table></div>\n");
    html
}

/// Milliseconds as people read them.
pub(crate) fn duration(ns: u64) -> String {
    match super::summary::ms(ns) {
        ms if ms < 10.0 => format!("{ms:.1} ms"),
        ms if ms < 950.0 => format!("{ms:.0} ms"),
        ms => format!("{:.2} s", ms / 1e3),
    }
}

/// A figure, or a dash where it is unknown.
fn or_dash(text: Option<String>) -> String {
    text.unwrap_or_else(|| "-".to_owned())
}
