//! The last screen: this run's figures beside the paper's.

use std::path::Path;

use crate::{
    render::units::wrap,
    report::{
        Report,
        page::{CAVEAT, PAPER_ACTIVATION_S, PAPER_RECOVERY_S, duration},
    },
};

/// Columns of a line.
const COLUMNS: usize = 79;

/// Its lines; `page` is where the report lies.
pub(super) fn lines(report: &Report, page: &Path) -> Vec<String> {
    let figures = &report.figures;
    let time = |ns: Option<u64>| ns.map_or_else(|| "unknown".to_owned(), duration);
    let (pause, median) = match figures.commands {
        Some(pause) => (Some(pause.gap_max_ns), pause.period_median_ns),
        None => (None, None),
    };
    let lost: u64 = figures.samples.values().map(|one| one.counts.lost).sum();
    let received: u64 = figures.samples.values().map(|one| one.counts.received).sum();
    let hold = report.extra.bars.and_then(|bars| bars.recovery_rssi_hold_s);
    let hold = hold.map(|hold| format!("after the hold of {hold} s")).unwrap_or_default();
    let row = |name: &str, here: &str, paper: &str, note: &str| {
        format!(" {name:<25}{here:<10}{paper:<10}{note}").trim_end().to_owned()
    };
    let components = format!("{} components active", report.run.components.len());
    let moved = format!("{} components moved", figures.moves.len());
    let mut lines = vec![
        String::new(),
        "                          here      the paper (3 Raspberry Pi 4, real Wi-Fi)".to_owned(),
        row(&components, &time(figures.activation_ns), &format!("{PAPER_ACTIVATION_S} s"), ""),
        row(&moved, &time(figures.recovery_ns), &format!("{PAPER_RECOVERY_S} s"), &hold),
        row("controller's pause", &time(pause), "-", &format!("median period {}", time(median))),
        format!(
            " {:<25}{lost} of {}, from each consumer's first on",
            "samples lost",
            received + lost
        ),
    ];
    if let (Some(_), Some((all, danger))) = (&report.extra.pictures, figures.verdicts) {
        lines.push(format!(" {:<25}{all}, danger seen in {danger}", "pictures looked at"));
    }
    lines.extend(CAVEAT.split_inclusive(": ").map(|part| format!(" {}", part.trim_end())));
    for note in &report.summary.notes {
        lines.extend(wrap(&format!(" note: {note}"), COLUMNS, "   "));
    }
    lines.push(String::new());
    let next = format!(" next:  open {:<28}", page.display().to_string());
    lines.extend(wrap(&format!("{next}  Figures 4 to 6"), COLUMNS, "        "));
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
    "        sdr demo --keep               leave the fleet up, then try sdr status".to_owned()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::report::{extra::Extra, tests::story::Story};

    #[test]
    fn the_last_screen_fits_eighty_columns() {
        let folder = tempfile::tempdir().unwrap();
        Story::whole().write(folder.path());
        let mut report = Report::make(&[folder.path().to_owned()], Extra::default()).unwrap();
        report.summary.notes.push("a word of some length ".repeat(9));

        let mut lines = lines(&report, Path::new("./sdr-demo-1000/of/some/length/report.html"));
        lines.push(further());
        lines.extend(kept(Path::new("/tmp/sdr-demo-abcdef/robot-1/agent.sock")));

        let wide: Vec<_> = lines.iter().filter(|line| line.chars().count() > COLUMNS).collect();
        assert!(wide.is_empty(), "{wide:#?}");
        assert!(lines.iter().any(|line| line.contains("report.html")), "{lines:#?}");
    }
}
