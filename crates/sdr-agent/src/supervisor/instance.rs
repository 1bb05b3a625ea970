//! The timers of one process: what is waited for, since when, for how long.

use std::time::Duration;

use sdr_core::{lifecycle::LifecycleState, spec::Execution, time::Instant};

use super::Patience;

/// Periods without a beat that are still fine.
const BEATS_MISSED_MAX: u32 = 5;

/// What one process is waited for.
#[derive(Debug)]
pub(super) struct Life {
    patience: Patience,
    /// Longest pause between two beats.
    beat_max: Duration,
    phase: Phase,
    /// When the phase, or in [`Phase::Active`] the last beat, was.
    since: Instant,
    /// Whether the present delay was told.
    told: bool,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Phase {
    /// The process runs; it has not greeted yet.
    Starting,
    /// It was configured; `on_initialize` runs.
    Initializing,
    /// Inactive, in error or finalised: nothing is due.
    Quiet,
    /// Beats are due.
    Active,
    /// It was asked to finish; SIGTERM is next.
    Finishing,
    /// SIGTERM was sent; SIGKILL is next.
    Terminating,
    /// SIGKILL was sent; the kernel does the rest.
    Killed,
}

/// What is overdue.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) enum Overdue {
    /// The brain should know.
    Hung(String),
    /// SIGTERM is due.
    Terminate,
    /// SIGKILL is due.
    Kill,
}

impl Life {
    pub(super) fn new(patience: Patience, execution: Execution, now: Instant) -> Self {
        let period = match execution {
            Execution::Periodic { period } => period,
            Execution::OnData => Duration::ZERO,
        };
        let beat_max = patience.beat.max(period.saturating_mul(BEATS_MISSED_MAX));
        Self { patience, beat_max, phase: Phase::Starting, since: now, told: false }
    }

    /// `configure` was sent.
    pub(super) fn configured(&mut self, now: Instant) {
        self.enter(Phase::Initializing, now);
    }

    /// It said which state it is in.
    pub(super) fn state(&mut self, state: LifecycleState, now: Instant) {
        let phase = match state {
            LifecycleState::Created => return,
            LifecycleState::Active => Phase::Active,
            LifecycleState::Inactive | LifecycleState::Error | LifecycleState::Finalized => {
                Phase::Quiet
            }
        };
        self.enter(phase, now);
    }

    /// Its execution thread gave a sign of life.
    pub(super) fn beat(&mut self, now: Instant) {
        if self.phase == Phase::Active {
            self.since = now;
            self.told = false;
        }
    }

    /// It was asked to finish.
    pub(super) fn finish(&mut self, now: Instant) {
        self.enter(Phase::Finishing, now);
    }

    /// SIGTERM was sent.
    pub(super) fn terminated(&mut self, now: Instant) {
        self.enter(Phase::Terminating, now);
    }

    /// SIGKILL was sent.
    pub(super) fn killed(&mut self, now: Instant) {
        self.enter(Phase::Killed, now);
    }

    /// The agent itself was late: beats may lie unread, so their window starts anew.
    pub(super) fn forgive(&mut self, now: Instant) {
        if self.phase == Phase::Active {
            self.since = now;
        }
    }

    /// Whether it is on its way out.
    pub(super) fn is_ending(&self) -> bool {
        match self.phase {
            Phase::Finishing | Phase::Terminating | Phase::Killed => true,
            Phase::Starting | Phase::Initializing | Phase::Quiet | Phase::Active => false,
        }
    }

    /// What is overdue at `now`; each delay is told once.
    pub(super) fn overdue(&mut self, now: Instant) -> Option<Overdue> {
        if self.deadline().is_none_or(|deadline| now < deadline) {
            return None;
        }
        self.told = true;
        let waited = now.since(self.since).as_secs_f64();
        match self.phase {
            Phase::Starting => Some(Overdue::Hung(format!("no greeting for {waited:.1} s"))),
            Phase::Initializing => {
                Some(Overdue::Hung(format!("on_initialize not done after {waited:.1} s")))
            }
            Phase::Active => Some(Overdue::Hung(format!(
                "no beat of its execution thread for {waited:.1} s, allowed {:.1} s",
                self.beat_max.as_secs_f64()
            ))),
            Phase::Finishing => Some(Overdue::Terminate),
            Phase::Terminating => Some(Overdue::Kill),
            Phase::Quiet | Phase::Killed => None,
        }
    }

    /// When to look at [`Self::overdue`] at the latest.
    pub(super) fn deadline(&self) -> Option<Instant> {
        if self.told {
            return None;
        }
        let patience = match self.phase {
            Phase::Starting => self.patience.hello,
            Phase::Initializing => self.patience.initialize,
            Phase::Active => self.beat_max,
            Phase::Finishing => self.patience.finish,
            Phase::Terminating => self.patience.terminate,
            Phase::Quiet | Phase::Killed => return None,
        };
        Some(self.since + patience)
    }

    fn enter(&mut self, phase: Phase, now: Instant) {
        // News of a component that is being ended do not stop its end.
        let rank = |phase| match phase {
            Phase::Starting | Phase::Initializing | Phase::Quiet | Phase::Active => 0,
            Phase::Finishing => 1,
            Phase::Terminating => 2,
            Phase::Killed => 3,
        };
        if rank(phase) >= rank(self.phase) && !(self.phase == phase && self.is_ending()) {
            self.phase = phase;
            self.since = now;
            self.told = false;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn life(period_ms: u64) -> Life {
        let period = Duration::from_millis(period_ms);
        Life::new(Patience::default(), Execution::Periodic { period }, Instant::ZERO)
    }

    fn at(ms: u64) -> Instant {
        Instant::from_millis(ms)
    }

    #[test]
    fn a_component_that_never_greets_is_told_once() {
        let mut life = life(20);
        assert_eq!(life.overdue(at(9_999)), None);
        assert!(matches!(life.overdue(at(10_000)), Some(Overdue::Hung(_))));
        assert_eq!(life.overdue(at(99_000)), None);
        assert_eq!(life.deadline(), None);
    }

    #[test]
    fn initialising_may_take_a_minute() {
        let mut life = life(20);
        life.configured(at(1_000));
        assert_eq!(life.overdue(at(60_999)), None);
        assert!(matches!(life.overdue(at(61_000)), Some(Overdue::Hung(_))));
    }

    #[test]
    fn beats_are_due_while_active_and_only_then() {
        let mut life = life(500);
        life.state(LifecycleState::Inactive, at(0));
        assert_eq!(life.deadline(), None);

        life.state(LifecycleState::Active, at(0));
        assert_eq!(life.deadline(), Some(at(2_500)));
        life.beat(at(400));
        assert_eq!(life.overdue(at(2_899)), None);
        assert!(matches!(life.overdue(at(2_900)), Some(Overdue::Hung(_))));

        life.beat(at(3_000));
        assert_eq!(life.deadline(), Some(at(5_500)));
    }

    #[test]
    fn an_agent_that_slept_judges_nobody() {
        let mut life = life(20);
        life.state(LifecycleState::Active, at(0));
        life.forgive(at(30_000));
        assert_eq!(life.overdue(at(30_000)), None);
    }

    #[test]
    fn asking_comes_before_telling_and_telling_before_killing() {
        let mut life = life(20);
        life.state(LifecycleState::Active, at(0));
        life.finish(at(100));
        life.state(LifecycleState::Active, at(200));
        life.finish(at(900));
        assert_eq!(life.overdue(at(1_100)), Some(Overdue::Terminate));
        life.terminated(at(1_100));
        assert_eq!(life.overdue(at(3_099)), None);
        assert_eq!(life.overdue(at(3_100)), Some(Overdue::Kill));
        life.killed(at(3_100));
        assert_eq!(life.deadline(), None);
    }
}
