//! Figures 4, 5, 6: free memory, RSSI and component states of each robot over time.

use sdr_core::recording::RobotMetrics;

use super::section;
use crate::report::{
    Report,
    run::State,
    svg::{
        Bar, LinePanel, Mark, MarkKind, Panel, Strip, StripPiece, StripState, TimeAxis, escape,
        stack,
    },
};

/// One figure for each robot.
pub(super) fn robots(report: &Report) -> String {
    let run = &report.run;
    let axis = TimeAxis::new(0.0, run.second(run.until_ns));
    let marks = marks(report);
    let mut html = String::from(
        "<p class=\"muted\"><span class=\"key allocation\"></span>allocation executed\
         <span class=\"key recovery\"></span>recovery executed\
         <span class=\"key bar\"></span>bars of Tables V and VI</p>\n",
    );
    for (index, (robot, metrics)) in run.robots.iter().enumerate() {
        let mut panels = vec![memory(report, metrics), radio(report, metrics)];
        panels.extend(strips(report, robot));
        let svg = stack(&format!("Status of {robot} over time"), &axis, &panels, &marks);
        let words = format!("Figure {}: status of {}.", index + 4, escape(robot));
        html.push_str(&format!("<figure>\n{svg}<figcaption>{words}</figcaption></figure>\n"));
    }
    section("Figures 4 to 6: each robot over time", &html)
}

fn memory(report: &Report, metrics: &[RobotMetrics]) -> Panel {
    let points = metrics
        .iter()
        .map(|one| (report.run.second(one.monotonic_ns), megabytes(one.memory_free_bytes)));
    let bars = report.extra.bars.iter().flat_map(|bars| {
        let known =
            [("Table V", bars.allocation_memory_bytes), ("Table VI", bars.recovery_memory_bytes)];
        known.into_iter().filter_map(|(table, bytes)| {
            let bytes = bytes?;
            let label = format!("{table}: {} MB", bytes / 1_000_000);
            Some(Bar { at: megabytes(bytes), label })
        })
    });
    Panel::Line(LinePanel {
        title: "Free memory".to_owned(),
        unit: "MB".to_owned(),
        points: points.collect(),
        bars: bars.collect(),
        zero: true,
    })
}

fn radio(report: &Report, metrics: &[RobotMetrics]) -> Panel {
    let points =
        metrics.iter().map(|one| (report.run.second(one.monotonic_ns), f64::from(one.rssi_dbm)));
    let bars = report.extra.bars.iter().filter_map(|bars| {
        let at = bars.recovery_rssi_dbm?;
        Some(Bar { at, label: format!("Table VI: {at:.1} dBm") })
    });
    Panel::Line(LinePanel {
        title: "RSSI".to_owned(),
        unit: "dBm".to_owned(),
        points: points.collect(),
        bars: bars.collect(),
        zero: false,
    })
}

/// One strip for each component that was ever there.
fn strips(report: &Report, robot: &str) -> Vec<Panel> {
    let run = &report.run;
    let mut strips = Vec::new();
    for component in &run.components {
        let here =
            run.stays.iter().filter(|stay| stay.robot == robot && stay.component == *component);
        let pieces: Vec<StripPiece> = here
            .map(|stay| {
                let (state, word) = match stay.state {
                    State::Inactive => (StripState::Inactive, "inactive"),
                    State::Active => (StripState::Active, "active"),
                    State::Error => (StripState::Error, "error"),
                };
                let label = if stay.epoch > 0 {
                    format!("{word}, epoch {}", stay.epoch)
                } else {
                    word.to_owned()
                };
                let (from_s, until_s) = (run.second(stay.from_ns), run.second(stay.until_ns));
                StripPiece { from_s, until_s, state, label }
            })
            .collect();
        if !pieces.is_empty() {
            strips.push(Panel::Strip(Strip { title: component.clone(), pieces }));
        }
    }
    strips
}

/// Orange: deployments. Purple: what was followed by moves.
fn marks(report: &Report) -> Vec<Mark> {
    let run = &report.run;
    let mut times: Vec<u64> = run.events_of("deployed").map(|event| event.monotonic_ns).collect();
    // Every robot that learns of a deployment may say so; one line is enough.
    times.dedup_by(|later, earlier| later.saturating_sub(*earlier) < 1_000_000_000);
    let deployed =
        times.into_iter().map(|at| Mark { at_s: run.second(at), kind: MarkKind::Allocation });
    let moved = report.figures.moves.iter().map(|one| one.active_ns);
    let recovered = report.figures.trouble_ns.into_iter().chain(moved.min()).take(1);
    deployed
        .chain(recovered.map(|at| Mark { at_s: run.second(at), kind: MarkKind::Recovery }))
        .collect()
}

#[expect(clippy::cast_precision_loss, reason = "a plot needs no single bytes")]
fn megabytes(bytes: u64) -> f64 {
    bytes as f64 / 1e6
}
