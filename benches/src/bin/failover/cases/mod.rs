//! What is broken: one file a case.

mod agent_kill;
mod crash_cold;

use std::fmt;

use clap::ValueEnum;
use sdr_benches::monotonic_ns;

use crate::fleet::{Fleet, Outcome, until};
use crate::report::Trial;
use crate::samples::Samples;

/// One case.
pub(crate) trait Case {
    /// How many robots it takes.
    fn robots(&self) -> usize;
    /// The system that runs on them.
    fn system(&self, fleet: &Fleet) -> String;
    /// Breaks it once, waits until all is well again, says how it was.
    fn trial(&mut self, fleet: &mut Fleet) -> Outcome<Trial>;
}

/// The cases there are.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub(crate) enum Name {
    /// The agent of a robot dies and is started again.
    AgentKill,
    /// A component's process dies and is started again at home.
    CrashCold,
}

impl fmt::Display for Name {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let value = self.to_possible_value().expect("no case is skipped");
        f.pad(value.get_name())
    }
}

/// The case of that name.
pub(crate) fn make(name: Name) -> Box<dyn Case> {
    match name {
        Name::AgentKill => Box::new(agent_kill::AgentKill),
        Name::CrashCold => Box::new(crash_cold::CrashCold),
    }
}

/// Period of the producer in crash cases: 1 kHz.
const PERIOD_NS: u64 = 1_000_000;
/// So many samples in a row mean that all is well.
const STEADY: usize = 100;

/// A producer at 1 kHz, its consumer, and a ladder that is at its foot again after half a second.
fn pair(fleet: &Fleet) -> String {
    let file = fleet.file("samples");
    format!(
        "system: probe\n\
         recovery:\n  extends: default\n  ladders:\n    quick:\n      \
         - restart: {{ tries: 3, settle: 500ms }}\n      - hold\n  rules: only\n  override:\n    \
         exited: {{ ladder: quick }}\n    hung: {{ ladder: quick }}\n  \
         limits: {{ restarts: 60000 per hour per component }}\n\
         components:\n  \
         source: {{ run: {{ native: probe_source }}, rate: 1kHz, needs: {{ memory: 50MB, cpu: 20% }} }}\n  \
         sink: {{ run: {{ native: probe_sink }}, execute: on-data, parameters: {{ file: {file:?} }}, \
         needs: {{ memory: 50MB, cpu: 20% }} }}\n\
         connections:\n  - {{ from: source.tick, to: sink.tick, depth: 64 }}\n"
    )
}

/// What the consumer of [`pair`] writes.
fn samples(fleet: &Fleet) -> Samples {
    Samples(fleet.file("samples"))
}

/// Waits until samples come without a gap; what came before is forgotten.
fn steady(samples: &Samples) -> Outcome<()> {
    samples.clear()?;
    let from = monotonic_ns();
    until("a steady flow of samples", || {
        let come = samples.since(from).unwrap_or_default();
        let last = come.get(come.len().saturating_sub(STEADY)..).unwrap_or_default();
        come.len() >= STEADY && last.windows(2).all(|two| two[0].token == two[1].token)
    })
}

/// Nanoseconds between two moments as milliseconds.
fn millis(from_ns: u64, to_ns: u64) -> f64 {
    #[expect(clippy::cast_precision_loss, reason = "below a minute")]
    let nanos = to_ns.saturating_sub(from_ns) as f64;
    nanos / 1e6
}
