//! The last screen: this run's figures beside the paper's.

use std::path::Path;

use crate::report::{
    Report,
    page::{CAVEAT, PAPER_ACTIVATION_S, PAPER_RECOVERY_S, duration},
};

/// Its lines; `page` is where the report lies.
pub(super) fn lines(report: &Report, page: &Path) -> Vec<String> {
    let figures = &report.figures;
    let time = |ns: Option<u64>| ns.map_or_else(|| "unknown".to_owned(), duration);
    let (pause, median) = match figures.commands {
        Some(pause) => (Some(pause.gap_max_ns), pause.period_median_ns),
        None => (None, None),
    };
    let lost: u64 = figures.samples.values().map(|(_, counts)| counts.lost).sum();
    let received: u64 = figures.samples.values().map(|(_, counts)| counts.received).sum();
    let row = |name: &str, here: &str, paper: &str, note: &str| {
        format!(" {name:<25}{here:<10}{paper:<10}{note}").trim_end().to_owned()
    };
    let components = format!("{} components active", report.run.components.len());
    let moved = format!("{} components moved", figures.moves.len());
    let mut lines = vec![
        String::new(),
        "                          here      the paper (3 Raspberry Pi 4, real Wi-Fi)".to_owned(),
        row(&components, &time(figures.activation_ns), &format!("{PAPER_ACTIVATION_S} s"), ""),
        row(
            &moved,
            &time(figures.recovery_ns),
            &format!("{PAPER_RECOVERY_S} s"),
            "after the hold of 6 s",
        ),
        row("controller's pause", &time(pause), "-", &format!("median period {}", time(median))),
        format!(" {:<25}{lost} of {}", "samples lost", received + lost),
    ];
    lines.extend(CAVEAT.split_inclusive(": ").map(|part| format!(" {}", part.trim_end())));
    for note in &report.summary.notes {
        lines.push(format!(" note: {note}"));
    }
    lines.push(String::new());
    let page = page.display().to_string();
    lines.push(format!(" next:  open {page:<28}  Figures 4 to 6"));
    lines
}

/// How to go on with a fleet that is left up.
pub(super) fn kept(socket: &Path) -> Vec<String> {
    vec![
        String::new(),
        " The fleet stays up until Ctrl-C. In another terminal:".to_owned(),
        format!("        export SDR_AGENT={}", socket.display()),
        "        sdr status; sdr events -f; sdr logs controller -f".to_owned(),
    ]
}

/// What else can be tried.
pub(super) fn further() -> String {
    "        sdr demo --keep                       leave the fleet up, then try sdr status"
        .to_owned()
}
