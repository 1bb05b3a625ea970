//! One component's way up a ladder: what was ordered, whether it helped, what comes next.

use alloc::{format, string::String};
use core::time::Duration;

use sdr_core::{
    recover::{Evidence, Remedy, RemedyOutcome},
    time::Instant,
};

use crate::{
    budget::Budget,
    ladder::{Ladder, Rung},
    policy::Limits,
    sustain::Stage,
};

/// How often a launch elsewhere may be refused before a component that is ill by itself is
/// held. A robot that is ill, or gone, never stops asking.
pub(crate) const REFUSALS_MAX: u32 = 8;

/// How long an order may stay without an answer once the component failed again under it.
pub(crate) const ANSWER_MAX: Duration = Duration::from_secs(30);

/// A cause that stands for a component, and how it was seen.
#[derive(Clone, Debug)]
pub(crate) struct Trouble {
    /// The rule's number.
    pub(crate) rule: usize,
    /// Since when.
    pub(crate) since: Instant,
    /// When it had held for its whole time.
    pub(crate) held_over_at: Instant,
    /// With numbers.
    pub(crate) reason: String,
}

/// A climb that is under way.
#[derive(Clone, Debug)]
pub(crate) struct Climb {
    pub(crate) trouble: Trouble,
    /// The robot is ill and nobody takes the component: it is helped here meanwhile.
    meanwhile: bool,
    /// The rung it stands on; never goes down.
    rung: usize,
    /// Orders given on this rung.
    tried: u32,
    /// Refusals of a launch elsewhere.
    refused: u32,
    phase: Phase,
}

#[derive(Clone, Copy, Debug)]
enum Phase {
    /// The next order should be given.
    Due { since: Instant },
    /// An order is out; its answer has not come.
    Ordered { answer_until: Option<Instant>, not_before: Instant },
    /// It was done; the fault must stay away. `calm` once the condition was over.
    Settling { until: Instant, calm: bool },
    /// It was refused; the same rung is asked again.
    Pausing { until: Instant },
}

/// What the evidence shows of the cause of a climb.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Signs {
    /// A fault came now, of whatever cause.
    pub(crate) fault: bool,
    /// How far the condition is; `None` when the cause is a fault by itself.
    pub(crate) condition: Option<Stage>,
    /// When the condition will be raised, while it is pending.
    pub(crate) raised_at: Option<Instant>,
}

impl Signs {
    fn gone(self) -> bool {
        matches!(self.condition, Some(Stage::Calm | Stage::Pending { .. }))
    }

    fn raised(self) -> bool {
        matches!(self.condition, Some(Stage::Raised { .. }))
    }
}

/// What a look at the evidence says of a climb.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Look {
    /// Nothing to do.
    Wait,
    /// Give the next order.
    Step,
    /// It helped, or the cause is gone: back at the bottom.
    Over,
}

/// What a step is made from.
pub(crate) struct Way<'a> {
    pub(crate) ladder: &'a Ladder,
    pub(crate) limits: &'a Limits,
    pub(crate) evidence: &'a Evidence,
    pub(crate) restarts: &'a mut Budget,
    pub(crate) moves: &'a mut Budget,
    /// Whether refusals of a launch elsewhere are endured for ever.
    pub(crate) patient: bool,
}

/// What a step decides.
pub(crate) enum Order {
    /// Try this.
    Try(Remedy, String),
    /// Stop trying; `until` when only a budget is spent.
    Hold { note: String, until: Option<Instant> },
}

impl Climb {
    pub(crate) fn new(now: Instant, trouble: Trouble) -> Self {
        let phase = Phase::Due { since: now };
        Self { trouble, meanwhile: false, rung: 0, tried: 0, refused: 0, phase }
    }

    /// A climb for `trouble` here, while nobody takes the component off an ill robot.
    pub(crate) fn meanwhile(now: Instant, trouble: Trouble) -> Self {
        Self { meanwhile: true, ..Self::new(now, trouble) }
    }

    /// Whether another cause, of the robot or not, has to wait until this climb is over.
    pub(crate) fn makes_wait(&self, rule: usize, of_robot: bool) -> bool {
        rule == self.trouble.rule || (self.meanwhile && of_robot)
    }

    /// Learns what came of the order; `true` when it was a move that was done.
    pub(crate) fn outcome(
        &mut self,
        now: Instant,
        outcome: RemedyOutcome,
        (ladder, limits, patient): (&Ladder, &Limits, bool),
    ) -> bool {
        let Phase::Ordered { not_before, .. } = self.phase else {
            return false;
        };
        let rung = ladder.rungs()[self.rung];
        match outcome {
            RemedyOutcome::Done => {
                let settle = match rung {
                    Rung::Restart(restart) => restart.settle,
                    Rung::LocalStandby
                    | Rung::StandbyElsewhere
                    | Rung::LaunchElsewhere
                    | Rung::Hold => limits.settle,
                };
                // A restart that is only planned yet has not had its time to help.
                let until = now.max(not_before) + settle;
                self.phase = Phase::Settling { until, calm: false };
                leaves(rung)
            }
            RemedyOutcome::Refused => {
                self.phase = Phase::Due { since: now };
                if rung == Rung::LaunchElsewhere {
                    self.refused = self.refused.saturating_add(1);
                    if patient || self.refused < REFUSALS_MAX {
                        let until = now + limits.retry.pause(self.refused);
                        self.phase = Phase::Pausing { until };
                    }
                }
                false
            }
        }
    }

    /// Whether the evidence calls for the next order, or for none any more.
    pub(crate) fn look(&mut self, now: Instant, signs: Signs, ladder: &Ladder) -> Look {
        let away = leaves(ladder.rungs()[self.rung]);
        match self.phase {
            Phase::Due { .. } if signs.gone() => Look::Over,
            Phase::Due { .. } => Look::Step,
            Phase::Ordered { .. } | Phase::Pausing { .. } if away && signs.gone() => Look::Over,
            Phase::Pausing { until } if now >= until => Look::Step,
            Phase::Pausing { .. } => Look::Wait,
            Phase::Ordered { .. } if away => Look::Wait,
            Phase::Ordered { answer_until, not_before } => {
                // Ending the process looks like a fault too, so it counts only when no
                // answer follows.
                let latest = now.max(not_before) + ANSWER_MAX;
                let noted = answer_until.or(signs.fault.then_some(latest));
                self.phase = Phase::Ordered { answer_until: noted, not_before };
                if noted.is_some_and(|until| now >= until) { Look::Step } else { Look::Wait }
            }
            Phase::Settling { until, calm } => self.look_settling(now, signs, (until, calm, away)),
        }
    }

    /// Gives the next order: the same rung while it has tries left, else the next one that
    /// can be climbed.
    pub(crate) fn step(&mut self, now: Instant, way: &mut Way<'_>) -> Order {
        let mut spent: Option<(&str, Option<Instant>)> = None;
        loop {
            let rung = way.ladder.rungs()[self.rung];
            if rung == Rung::Hold {
                return self.hold(way, spent);
            }
            if self.can_try(rung, way) {
                let (budget, limit, word) = match leaves(rung) {
                    true => (&mut *way.moves, way.limits.moves_per_hour, "moves"),
                    false => (&mut *way.restarts, way.limits.restarts_per_hour, "restarts"),
                };
                if budget.has_room(now, limit) {
                    return self.order(now, rung, way);
                }
                let sooner = match spent {
                    Some((_, until)) => until.into_iter().chain(budget.frees_at()).min(),
                    None => budget.frees_at(),
                };
                spent = Some((word, sooner));
            }
            self.rung += 1;
            self.tried = 0;
        }
    }

    /// When it should be looked at again at the latest.
    pub(crate) fn deadline(&self) -> Option<Instant> {
        match self.phase {
            Phase::Due { since } => Some(since),
            Phase::Ordered { answer_until, .. } => answer_until,
            Phase::Settling { until, .. } | Phase::Pausing { until } => Some(until),
        }
    }

    /// Whether a move is ordered that has not been answered.
    pub(crate) fn is_leaving(&self, ladder: &Ladder) -> bool {
        matches!(self.phase, Phase::Ordered { .. }) && leaves(ladder.rungs()[self.rung])
    }

    /// Whether it waits to ask again for what was refused.
    pub(crate) fn is_pausing(&self) -> bool {
        matches!(self.phase, Phase::Pausing { .. })
    }

    /// How severe the rung is that it stands on.
    pub(crate) fn severity(&self, ladder: &Ladder) -> u8 {
        ladder.rungs()[self.rung].severity()
    }

    fn look_settling(
        &mut self,
        now: Instant,
        signs: Signs,
        (until, calm, away): (Instant, bool, bool),
    ) -> Look {
        // What happens to the instance that was left behind is no sign of the new one.
        if !away && signs.fault {
            // Where the condition is over, a fault is a matter of its own.
            return if signs.gone() { Look::Over } else { Look::Step };
        }
        if !away && calm && signs.raised() {
            return Look::Step;
        }
        self.phase = Phase::Settling { until, calm: calm || signs.gone() };
        if now < until {
            return Look::Wait;
        }
        if signs.raised() {
            return Look::Step;
        }
        match signs.raised_at.filter(|_| !away) {
            // It may be about to come back: wait for that, too.
            Some(raised_at) => {
                self.phase = Phase::Settling { until: raised_at, calm: true };
                Look::Wait
            }
            None => Look::Over,
        }
    }

    /// Whether the rung is worth an order at all, budgets aside.
    fn can_try(&self, rung: Rung, way: &Way<'_>) -> bool {
        match rung {
            Rung::LocalStandby => self.tried == 0 && way.evidence.standby_here,
            Rung::Restart(restart) => self.tried < u32::from(restart.tries.get()),
            Rung::StandbyElsewhere => self.tried == 0 && way.evidence.standby_elsewhere,
            Rung::LaunchElsewhere => way.patient || self.refused < REFUSALS_MAX,
            Rung::Hold => true,
        }
    }

    fn order(&mut self, now: Instant, rung: Rung, way: &mut Way<'_>) -> Order {
        let (remedy, note, after) = match rung {
            Rung::LocalStandby => (Remedy::LocalStandby, String::new(), Duration::ZERO),
            Rung::Restart(restart) => {
                let after = restart.backoff.pause(self.tried);
                let note = format!("; restart {} of {}", self.tried + 1, restart.tries);
                (Remedy::Restart { after }, note, after)
            }
            Rung::StandbyElsewhere => (Remedy::StandbyElsewhere, String::new(), Duration::ZERO),
            Rung::LaunchElsewhere => {
                let note = match self.refused {
                    0 => String::new(),
                    times => format!("; refused {times} times so far"),
                };
                (Remedy::LaunchElsewhere, note, Duration::ZERO)
            }
            Rung::Hold => (Remedy::Hold, String::new(), Duration::ZERO),
        };
        // A move is counted when it is done: one that is refused costs nothing.
        if !leaves(rung) {
            way.restarts.spend(now, way.limits.restarts_per_hour);
        }
        self.tried = self.tried.saturating_add(1);
        self.phase = Phase::Ordered { answer_until: None, not_before: now + after };
        Order::Try(remedy, note)
    }

    fn hold(&self, way: &Way<'_>, spent: Option<(&str, Option<Instant>)>) -> Order {
        let note = match spent {
            Some((word, _)) => {
                let limit = match word {
                    "moves" => way.limits.moves_per_hour,
                    _ => way.limits.restarts_per_hour,
                };
                format!("; held, the {limit} {word} of this hour are spent")
            }
            None if self.rung == 0 => String::from("; held until reset, as the policy says"),
            None if self.refused > 0 => {
                format!("; held, no home in {} tries", self.refused)
            }
            None => String::from("; held, nothing else is left to try"),
        };
        Order::Hold { note, until: spent.and_then(|(_, until)| until) }
    }
}

/// Whether the remedy of a rung takes the component off its robot.
fn leaves(rung: Rung) -> bool {
    match rung {
        Rung::StandbyElsewhere | Rung::LaunchElsewhere => true,
        Rung::LocalStandby | Rung::Restart(_) | Rung::Hold => false,
    }
}
