//! `report.json`. Field names are contracts (`docs/report.md`); `null` is unknown.

use std::collections::BTreeMap;

use sdr_core::recording::RobotMetrics;
use serde::Serialize;

use super::{
    extra::{Coordinator, Detector, Extra, Radio},
    figures::Figures,
    machine::Machine,
    run::Run,
};

/// The whole of `report.json`.
#[derive(Debug, Serialize)]
pub(crate) struct Summary {
    /// Version of this format.
    pub(crate) format: u32,
    pub(crate) systems: Vec<String>,
    pub(crate) robots: Vec<String>,
    pub(crate) duration_s: f64,
    pub(crate) ballast: Option<bool>,
    pub(crate) activation_ms: Option<f64>,
    pub(crate) recovery_ms: Option<f64>,
    pub(crate) stream_gap_ms: BTreeMap<String, Option<StreamGap>>,
    pub(crate) controller_gap_ms: Option<ControllerGap>,
    pub(crate) placement_before: BTreeMap<String, String>,
    pub(crate) placement_after: BTreeMap<String, String>,
    pub(crate) epochs: BTreeMap<String, u64>,
    pub(crate) samples: BTreeMap<String, Samples>,
    pub(crate) agents: BTreeMap<String, AgentUse>,
    pub(crate) coordinator: Coordinator,
    pub(crate) position_error_m: Option<PositionError>,
    pub(crate) detector: Option<Detector>,
    pub(crate) verdicts: Option<Verdicts>,
    pub(crate) pictures: Option<String>,
    pub(crate) machine: Option<Machine>,
    pub(crate) radio: Option<Radio>,
    pub(crate) events: usize,
    /// What is missing or was left out, in sentences.
    pub(crate) notes: Vec<String>,
    pub(crate) recordings: Vec<String>,
}

/// Longest pause around the move, and the usual one.
#[derive(Debug, Serialize)]
pub(crate) struct StreamGap {
    pub(crate) gap_max_ms: f64,
    pub(crate) period_median_ms: Option<f64>,
    pub(crate) bar_ms: Option<f64>,
}

/// The same for the commands that reach the wheels.
#[derive(Debug, Serialize)]
pub(crate) struct ControllerGap {
    pub(crate) max: f64,
    pub(crate) period_median_ms: Option<f64>,
}

/// Samples of one connection.
#[derive(Debug, Serialize)]
pub(crate) struct Samples {
    pub(crate) sent: Option<u64>,
    pub(crate) received: u64,
    pub(crate) lost: u64,
    pub(crate) unheard: Option<u64>,
    pub(crate) fenced: u64,
    pub(crate) late: u64,
    pub(crate) silent_ms: Option<f64>,
}

/// What an agent took: medians over the run, and the largest memory.
#[derive(Debug, Serialize)]
pub(crate) struct AgentUse {
    pub(crate) rss_bytes: Option<u64>,
    pub(crate) pss_bytes: Option<u64>,
    pub(crate) cpu_permille: Option<u64>,
    pub(crate) rss_bytes_max: Option<u64>,
}

/// Distance between the position estimate and the world's truth.
#[derive(Debug, Serialize)]
pub(crate) struct PositionError {
    pub(crate) mean: f64,
    pub(crate) max: f64,
}

/// What the detector said, once for each picture.
#[derive(Debug, Serialize)]
pub(crate) struct Verdicts {
    pub(crate) all: u64,
    pub(crate) danger: u64,
}

impl Summary {
    pub(crate) fn new(run: &Run, figures: &Figures, extra: &Extra) -> Self {
        let gap = |pause: &super::link::Pause| StreamGap {
            gap_max_ms: ms(pause.gap_max_ns),
            period_median_ms: pause.period_median_ns.map(ms),
            bar_ms: pause.bar_ns().map(ms),
        };
        let samples = figures.samples.iter().map(|(name, traffic)| {
            let counts = &traffic.counts;
            let samples = Samples {
                sent: traffic.sent,
                unheard: traffic.unheard,
                received: counts.received,
                lost: counts.lost,
                fenced: counts.fenced,
                late: counts.late,
                silent_ms: run.links.get(name).and_then(|link| link.silent_ns()).map(ms),
            };
            (name.clone(), samples)
        });
        let pauses = figures.pauses.iter();
        Self {
            format: 1,
            systems: run.systems.iter().cloned().collect(),
            robots: run.robots.keys().cloned().collect(),
            duration_s: round(run.second(run.until_ns)),
            ballast: extra.ballast,
            activation_ms: figures.activation_ns.map(ms),
            recovery_ms: figures.recovery_ns.map(ms),
            stream_gap_ms: pauses
                .map(|(name, pause)| (name.clone(), pause.as_ref().map(gap)))
                .collect(),
            controller_gap_ms: figures.commands.map(|pause| ControllerGap {
                max: ms(pause.gap_max_ns),
                period_median_ms: pause.period_median_ns.map(ms),
            }),
            placement_before: figures.placement_before.clone(),
            placement_after: figures.placement_after.clone(),
            epochs: figures.epochs.clone(),
            samples: samples.collect(),
            agents: run
                .robots
                .iter()
                .map(|(name, list)| (name.clone(), AgentUse::of(list)))
                .collect(),
            coordinator: coordinator(run, figures, extra),
            position_error_m: figures
                .position_error_m
                .map(|(mean, max)| PositionError { mean: round(mean), max: round(max) }),
            detector: extra.detector.clone(),
            verdicts: figures.verdicts.map(|(all, danger)| Verdicts { all, danger }),
            pictures: extra.pictures.clone(),
            machine: extra.machine.clone(),
            radio: extra.radio.clone(),
            events: run.events.len(),
            notes: Vec::new(),
            recordings: Vec::new(),
        }
    }
}

impl AgentUse {
    fn of(metrics: &[RobotMetrics]) -> Self {
        let known = |value: fn(&RobotMetrics) -> u64| {
            let mut values: Vec<u64> = metrics.iter().map(value).collect();
            values.sort_unstable();
            values
        };
        let median = |values: &[u64]| values.get(values.len() / 2).copied();
        let rss: Vec<u64> =
            known(|one| one.agent_rss_bytes).into_iter().filter(|bytes| *bytes > 0).collect();
        let pss: Vec<u64> =
            known(|one| one.agent_pss_bytes).into_iter().filter(|bytes| *bytes > 0).collect();
        Self {
            rss_bytes: median(&rss),
            pss_bytes: median(&pss),
            cpu_permille: median(&known(|one| u64::from(one.agent_cpu_permille))),
            rss_bytes_max: rss.last().copied(),
        }
    }
}

/// As the status said; else as the recordings' `role-taken` events say.
fn coordinator(run: &Run, figures: &Figures, extra: &Extra) -> Coordinator {
    let holder_at = |at_ns: u64| {
        let taken = run.events_of("role-taken").filter(|event| event.monotonic_ns <= at_ns);
        taken.last().map(|event| event.robot.clone())
    };
    let start = figures.deployed_ns.unwrap_or(run.from_ns);
    Coordinator {
        at_start: extra.coordinator.at_start.clone().or_else(|| holder_at(start)),
        at_end: extra.coordinator.at_end.clone().or_else(|| holder_at(run.until_ns)),
    }
}

/// Nanoseconds as milliseconds, to a thousandth.
pub(crate) fn ms(ns: u64) -> f64 {
    round(super::run::seconds(ns) * 1e3)
}

fn round(value: f64) -> f64 {
    (value * 1e3).round() / 1e3
}
