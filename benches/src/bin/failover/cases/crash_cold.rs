//! `kill -9` of a producer without standbys: its process is started again at home.

use std::thread;
use std::time::Duration;

use sdr_benches::monotonic_ns;

use super::{Case, PERIOD_NS, millis, pair, samples, steady};
use crate::fleet::{Fleet, Outcome, kill, until};
use crate::report::Trial;
use crate::samples::{Sample, gaps};

/// Until the ladder is at its foot again: its `settle`, and a little.
const SETTLED: Duration = Duration::from_millis(700);

pub(super) struct CrashCold;

impl Case for CrashCold {
    fn robots(&self) -> usize {
        1
    }

    fn system(&self, fleet: &Fleet) -> String {
        pair(fleet)
    }

    fn trial(&mut self, fleet: &mut Fleet) -> Outcome<Trial> {
        let samples = samples(fleet);
        steady(&samples)?;
        let agent = &fleet.agents[0];
        let pid = agent.pid_of("source").ok_or("no process of source")?;
        let before_ns = monotonic_ns();
        let old = samples.since(0)?.last().map(|sample| sample.token).ok_or("no sample")?;

        let killed_ns = monotonic_ns();
        kill(pid)?;

        let is_new = |sample: &Sample| sample.token > old;
        until("samples of a new process", || {
            samples.since(before_ns).is_ok_and(|seen| seen.iter().any(is_new))
        })?;
        until("the consumer's switch is known", || !agent.events("heard", killed_ns).is_empty())?;
        thread::sleep(SETTLED);
        let seen = samples.since(killed_ns.saturating_sub(20 * PERIOD_NS))?;
        let last_old = seen.iter().rfind(|sample| sample.token == old).ok_or("no old sample")?;
        let first_new = seen.iter().find(|sample| is_new(sample)).ok_or("no new sample")?;
        let pause_ns = first_new.accepted_ns - last_old.accepted_ns;
        let when = |kind: &str| {
            let first = agent.events(kind, killed_ns).first().map(|view| view.monotonic_ns);
            first.ok_or_else(|| format!("no event `{kind}`"))
        };
        let settled_ns = when("active")?.max(when("heard")?);
        let (lost, duplicates) = gaps(&seen);
        Ok(Trial {
            pause_ms: millis(0, pause_ns),
            total_ms: millis(killed_ns, settled_ns),
            detection_ms: millis(killed_ns, when("exited")?),
            lost: lost + (pause_ns / PERIOD_NS).saturating_sub(1),
            duplicates,
        })
    }
}
