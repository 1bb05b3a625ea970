//! The timers of one process: what is waited for, since when, for how long.

use std::collections::VecDeque;
use std::time::Duration;

use sdr_core::{lifecycle::LifecycleState, recover::HangLimit, spec::Execution, time::Instant};

use super::Patience;

/// Periods without a beat that are still fine.
const BEATS_MISSED_MAX: u16 = 5;

/// What one process is waited for.
#[derive(Debug)]
pub(super) struct Life {
    patience: Patience,
    /// The period of a periodic component.
    period: Duration,
    /// Longest pause between two beats while active.
    beat_max: Duration,
    /// Longest pause between two beats while inactive.
    beat_idle_max: Duration,
    phase: Phase,
    /// When the phase, or the last beat in it, was.
    since: Instant,
    /// Orders that were sent and not answered; they are carried out one after the other.
    orders: VecDeque<&'static str>,
    /// Since when the first of them is waited for.
    order_since: Instant,
    /// Since when it has no connection, once it had one.
    unlinked_at: Option<Instant>,
    /// Whether it was seen initialised.
    initialized: bool,
    /// Whether it is to greet after the death of an agent.
    returning: bool,
    /// Whether the present delay was told.
    told: bool,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Phase {
    /// The process runs; it has not greeted yet.
    Starting,
    /// It outlived an agent, and has not greeted this one yet.
    Returning,
    /// It was configured; `on_initialize` runs.
    Initializing,
    /// Beats are due, a few.
    Inactive,
    /// Beats are due.
    Active,
    /// The brain knows and orders what is to be done.
    Error,
    /// It ended by itself; its process should, too.
    Finalized,
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

/// One thing that is waited for.
#[derive(Clone, Copy, Debug)]
struct Wait {
    since: Instant,
    limit: Duration,
    what: What,
}

#[derive(Clone, Copy, Debug)]
enum What {
    Greeting,
    Initialized,
    Answer(&'static str),
    Beat,
    Connection,
    Exit,
    Terminate,
    Kill,
}

impl Life {
    pub(super) fn new(patience: Patience, execution: Execution, now: Instant) -> Self {
        let period = match execution {
            Execution::Periodic { period } => period,
            Execution::OnData => Duration::ZERO,
        };
        let missed_max = period.saturating_mul(BEATS_MISSED_MAX.into());
        Self {
            patience,
            period,
            beat_max: patience.beat.max(missed_max),
            beat_idle_max: patience.beat_idle.max(missed_max),
            phase: Phase::Starting,
            since: now,
            orders: VecDeque::new(),
            order_since: now,
            unlinked_at: None,
            initialized: false,
            returning: false,
            told: false,
        }
    }

    /// Takes it for hung after this silence while active; `None`: after the usual one.
    pub(super) fn be_patient(&mut self, limit: Option<HangLimit>) {
        let usual = HangLimit::Periods(BEATS_MISSED_MAX);
        self.beat_max = match limit.unwrap_or(usual) {
            HangLimit::Periods(periods) => {
                self.patience.beat.max(self.period.saturating_mul(periods.into()))
            }
            HangLimit::Time(limit) => limit,
        };
    }

    /// It ran before this agent did, and greets soon.
    pub(super) fn adopted(&mut self) {
        self.phase = Phase::Returning;
        self.returning = true;
    }

    /// Whether its first greeting after the death of an agent is still to come.
    pub(super) fn is_returning(&self) -> bool {
        self.returning
    }

    /// `configure` was sent.
    pub(super) fn configured(&mut self, now: Instant) {
        self.enter(Phase::Initializing, now);
    }

    /// An order was sent.
    pub(super) fn ordered(&mut self, what: &'static str, now: Instant) {
        if self.orders.is_empty() {
            self.order_since = now;
        }
        self.orders.push_back(what);
    }

    /// It said which state it is in.
    pub(super) fn state(&mut self, state: LifecycleState, now: Instant) {
        let phase = match state {
            LifecycleState::Created => return,
            LifecycleState::Inactive => Phase::Inactive,
            LifecycleState::Active => Phase::Active,
            LifecycleState::Error => Phase::Error,
            LifecycleState::Finalized => Phase::Finalized,
        };
        self.answered(now);
        self.initialized |= matches!(phase, Phase::Inactive | Phase::Active);
        self.enter(phase, now);
    }

    /// It said a state or refused: its oldest order is settled.
    pub(super) fn answered(&mut self, now: Instant) {
        // The first state answers `configure`; orders that came with it begin only now.
        if self.phase != Phase::Initializing {
            self.orders.pop_front();
        }
        self.order_since = now;
        // What ran until now kept beats away.
        self.restart_beats(now);
    }

    /// Its execution thread gave a sign of life.
    pub(super) fn beat(&mut self, now: Instant) {
        if matches!(self.phase, Phase::Inactive | Phase::Active) && self.orders.is_empty() {
            self.told = false;
        }
        self.restart_beats(now);
    }

    /// Its connection was lost; what was ordered on it may never have come.
    pub(super) fn unlinked(&mut self, now: Instant) {
        self.orders.clear();
        self.unlinked_at.get_or_insert(now);
    }

    /// It connected, anew or at first.
    pub(super) fn linked(&mut self, now: Instant) {
        self.returning = false;
        if self.unlinked_at.take().is_some() {
            self.told = false;
            self.restart_beats(now);
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

    /// The agent itself was late: beats, answers and greetings may lie unread, so their
    /// windows start anew.
    pub(super) fn forgive(&mut self, now: Instant) {
        self.order_since = now;
        self.unlinked_at = self.unlinked_at.map(|_| now);
        self.restart_beats(now);
    }

    /// Whether it is on its way out.
    pub(super) fn is_ending(&self) -> bool {
        match self.phase {
            Phase::Finishing | Phase::Terminating | Phase::Killed => true,
            Phase::Starting
            | Phase::Returning
            | Phase::Initializing
            | Phase::Inactive
            | Phase::Active
            | Phase::Error
            | Phase::Finalized => false,
        }
    }

    /// What is overdue at `now`; each delay is told once.
    pub(super) fn overdue(&mut self, now: Instant) -> Option<Overdue> {
        let wait = self.wait().filter(|wait| !self.told && now >= wait.since + wait.limit)?;
        self.told = true;
        let waited = now.since(wait.since).as_secs_f64();
        let reason = match wait.what {
            What::Greeting => format!("no greeting for {waited:.1} s"),
            What::Initialized => format!("on_initialize not done after {waited:.1} s"),
            What::Answer(order) => format!("`{order}` not answered by a state for {waited:.1} s"),
            What::Beat => format!(
                "no beat of its execution thread for {waited:.1} s, allowed {:.1} s{}",
                wait.limit.as_secs_f64(),
                if self.unlinked_at.is_some() { "; its connection is closed" } else { "" }
            ),
            What::Connection => format!("connection closed and not opened again for {waited:.1} s"),
            What::Exit => format!("finalized, but its process goes on for {waited:.1} s"),
            What::Terminate => return Some(Overdue::Terminate),
            What::Kill => return Some(Overdue::Kill),
        };
        Some(Overdue::Hung(reason))
    }

    /// When to look at [`Self::overdue`] at the latest.
    pub(super) fn deadline(&self) -> Option<Instant> {
        let wait = self.wait().filter(|_| !self.told)?;
        Some(wait.since + wait.limit)
    }

    /// What is due first.
    fn wait(&self) -> Option<Wait> {
        let patience = &self.patience;
        let (limit, what) = match self.phase {
            Phase::Starting => (patience.hello, What::Greeting),
            Phase::Returning => (patience.reconnect, What::Greeting),
            Phase::Initializing => (patience.initialize, What::Initialized),
            Phase::Inactive | Phase::Active | Phase::Error if !self.orders.is_empty() => {
                return self.sooner(self.wait_for_answer());
            }
            Phase::Inactive => (self.beat_idle_max, What::Beat),
            Phase::Active => (self.beat_max, What::Beat),
            Phase::Finalized => (patience.order, What::Exit),
            Phase::Finishing => (patience.finish, What::Terminate),
            Phase::Terminating => (patience.terminate, What::Kill),
            Phase::Error => return self.sooner(None),
            Phase::Killed => return None,
        };
        self.sooner(Some(Wait { since: self.since, limit, what }))
    }

    /// The callback of an order keeps beats away; it has a limit of its own.
    fn wait_for_answer(&self) -> Option<Wait> {
        let order = self.orders.front()?;
        // `reset` of one that never came up initialises it.
        let limit = if self.initialized { self.patience.order } else { self.patience.initialize };
        Some(Wait { since: self.order_since, limit, what: What::Answer(order) })
    }

    /// `wait`, or the new connection when that is due before.
    fn sooner(&self, wait: Option<Wait>) -> Option<Wait> {
        let matters = match self.phase {
            Phase::Initializing | Phase::Inactive | Phase::Active | Phase::Error => true,
            Phase::Starting
            | Phase::Returning
            | Phase::Finalized
            | Phase::Finishing
            | Phase::Terminating
            | Phase::Killed => false,
        };
        let limit = self.patience.reconnect;
        let connection = self.unlinked_at.filter(|_| matters).map(|since| Wait {
            since,
            limit,
            what: What::Connection,
        });
        wait.into_iter().chain(connection).min_by_key(|wait| wait.since + wait.limit)
    }

    fn restart_beats(&mut self, now: Instant) {
        if matches!(self.phase, Phase::Inactive | Phase::Active) {
            self.since = now;
        }
    }

    fn enter(&mut self, phase: Phase, now: Instant) {
        // News of a component that is being ended do not stop its end.
        let rank = |phase| match phase {
            Phase::Starting
            | Phase::Returning
            | Phase::Initializing
            | Phase::Inactive
            | Phase::Active
            | Phase::Error
            | Phase::Finalized => 0,
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
mod tests;
