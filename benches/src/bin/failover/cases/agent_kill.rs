//! `kill -9` of an agent, and the next one: components go on, and are adopted.

use std::thread;
use std::time::Duration;

use sdr_benches::monotonic_ns;

use super::{Case, millis, pair, samples, steady};
use crate::fleet::{Fleet, Outcome, until};
use crate::report::Trial;
use crate::samples::{gaps, longest_pause_ns};

/// How long is looked at before the death and after the adoption, for pauses.
const AROUND: Duration = Duration::from_millis(200);

pub(super) struct AgentKill;

impl Case for AgentKill {
    fn robots(&self) -> usize {
        1
    }

    fn system(&self, fleet: &Fleet) -> String {
        pair(fleet)
    }

    fn trial(&mut self, fleet: &mut Fleet) -> Outcome<Trial> {
        let samples = samples(fleet);
        steady(&samples)?;
        let agent = &mut fleet.agents[0];
        let before = (agent.pid_of("source"), agent.pid_of("sink"));
        let from_ns = monotonic_ns();
        thread::sleep(AROUND);

        agent.kill()?;
        let started_ns = agent.start()?;

        until("both adopted", || agent.events("adopted", started_ns).len() >= 2)?;
        thread::sleep(AROUND);
        let adopted: Vec<u64> =
            agent.events("adopted", started_ns).iter().map(|view| view.monotonic_ns).collect();
        if (agent.pid_of("source"), agent.pid_of("sink")) != before {
            return Err("another process runs than before".into());
        }
        let seen = samples.since(from_ns)?;
        if seen.windows(2).any(|two| two[0].token != two[1].token) {
            return Err("the token changed".into());
        }
        let (lost, duplicates) = gaps(&seen);
        let first = adopted.iter().min().copied().unwrap_or(started_ns);
        let last = adopted.iter().max().copied().unwrap_or(started_ns);
        Ok(Trial {
            pause_ms: millis(0, longest_pause_ns(&seen)),
            total_ms: millis(started_ns, last),
            detection_ms: millis(started_ns, first),
            lost,
            duplicates,
        })
    }
}
