//! One component: the conditions of its own, the climb it is on, and what it is held for.

use alloc::{collections::BTreeMap, string::String, vec::Vec};
use core::time::Duration;

use sdr_core::{
    recover::{Evidence, Remedy, Verdict},
    time::Instant,
};

use crate::{
    budget::Budget,
    climb::{Climb, Look, Order, Signs, Trouble, Way},
    counts::Counts,
    ladder::Rung,
    level::{Level, Unit},
    policy::{Policy, Rule},
    sustain::{Stage, Sustain},
};

/// How long a component that failed while it was to leave may wait for its new home before it
/// is started here again.
const MOVE_MAX: Duration = Duration::from_secs(5);

/// What is remembered of one component.
#[derive(Debug, Default)]
pub(crate) struct Watch {
    /// Conditions of its own, by rule.
    pub(crate) own: BTreeMap<usize, Sustain>,
    /// What happens to it is counted.
    counts: Counts,
    pub(crate) climb: Option<Climb>,
    pub(crate) held: BTreeMap<usize, Held>,
    /// A fault that came while a move was under way, and when it is dealt with here if the
    /// move comes to nothing.
    pub(crate) missed: Option<(Instant, Trouble)>,
    /// Restarts and local switches.
    pub(crate) restarts: Budget,
    /// When there was evidence of it last.
    pub(crate) seen_at: Instant,
    /// It moves a body.
    pub(crate) actuator: bool,
}

/// A cause that nothing more is tried for.
#[derive(Debug)]
pub(crate) struct Held {
    pub(crate) trouble: Trouble,
    at: Instant,
    /// When a budget has room again.
    until: Option<Instant>,
    /// Only a reset ends it.
    latched: bool,
}

/// The surroundings of one judgement of one component.
pub(crate) struct Scene<'a> {
    pub(crate) now: Instant,
    pub(crate) policy: &'a Policy,
    /// Conditions of the robot, by rule.
    pub(crate) robot: &'a BTreeMap<usize, Sustain>,
    pub(crate) evidence: &'a Evidence,
    pub(crate) moves: &'a mut Budget,
}

impl Watch {
    /// Takes fresh evidence for the conditions of its own.
    pub(crate) fn feed(&mut self, now: Instant, seen: &Evidence, rules: &[Rule]) {
        (self.seen_at, self.actuator) = (now, seen.actuator);
        let Self { own, counts, .. } = self;
        counts.feed(now, seen, rules);
        for (index, rule) in rules.iter().enumerate() {
            let Some(condition) = rule.trigger.condition().filter(|one| !one.fact.is_shared())
            else {
                continue;
            };
            let sustain = own.entry(index).or_insert_with(|| Sustain::new(condition));
            match condition.fact.unit() {
                Unit::Rate => sustain.feed(now, Some(counts.level(now, index))),
                Unit::Flag => {
                    let (holds, note) = counts.told(now, rule, seen);
                    if holds != Some(false) {
                        sustain.note = note;
                    }
                    sustain.feed(now, holds.map(Level::Flag));
                }
                Unit::Memory | Unit::Share | Unit::Signal | Unit::Time => {
                    sustain.feed(now, condition.fact.read(seen, condition.over));
                }
            }
        }
    }

    /// A remedy was done for `rule`: what it counts begins from nothing.
    pub(crate) fn count_anew(&mut self, rule: usize) {
        self.counts.clear(rule);
    }

    /// Says what should be done now about `troubles`: one order, after the causes that it is
    /// held for from now on.
    pub(crate) fn judge(
        &mut self,
        scene: &mut Scene<'_>,
        mut troubles: Vec<Trouble>,
    ) -> Vec<Verdict> {
        troubles.extend(self.leave_holds(scene));
        let mut verdicts = Vec::new();
        // Each hold takes one cause away, so this ends.
        while let Some(verdict) = self.judge_once(scene, troubles.clone()) {
            let held = verdict.remedy == Remedy::Hold;
            verdicts.push(verdict);
            if !held {
                break;
            }
        }
        verdicts
    }

    fn judge_once(&mut self, scene: &mut Scene<'_>, mut troubles: Vec<Trouble>) -> Option<Verdict> {
        let now = scene.now;
        if self.is_latched() {
            return None;
        }
        troubles.retain(|trouble| !self.held.contains_key(&trouble.rule));
        let first = |rule: usize| first_severity(scene.policy, rule, self.actuator);
        let by_weight = |trouble: &Trouble| (first(trouble.rule), usize::MAX - trouble.rule);
        let fault = troubles.iter().find(|trouble| is_fault(scene.policy, trouble.rule)).cloned();
        let winner = troubles.into_iter().max_by_key(by_weight);
        let Some(climb) = &mut self.climb else {
            return self.start_with(scene, winner);
        };
        let ladder = scene.policy.ladder(&rules(scene.policy)[climb.trouble.rule], self.actuator);
        if let Some(worse) = winner.clone().filter(|worse| {
            let of_robot = rules(scene.policy)[worse.rule].is_of_robot();
            !climb.makes_wait(worse.rule, of_robot) && first(worse.rule) > climb.severity(ladder)
        }) {
            return self.start(scene, worse);
        }
        let (leaving, pausing) = (climb.is_leaving(ladder), climb.is_pausing());
        let fault = fault.filter(|fault| fault.rule != climb.trouble.rule);
        if let Some(fault) = fault.clone()
            && rules(scene.policy)[climb.trouble.rule].is_of_robot()
            && (leaving || pausing)
            && self.missed.is_none()
        {
            self.missed = Some((now + MOVE_MAX, fault));
        }
        if let Some((_, fault)) =
            self.missed.take_if(|(due, _)| pausing || (leaving && now >= *due))
        {
            // It stays here for now, so it should at least run here.
            self.climb = Some(Climb::meanwhile(now, fault));
            return self.step(scene);
        }
        let signs = signs(&self.own, scene, climb.trouble.rule);
        match climb.look(now, signs, ladder) {
            Look::Wait => None,
            Look::Step => {
                if let Some(fault) = fault.filter(|_| signs.condition.is_some()) {
                    // Should the next rung be a move that comes to nothing.
                    self.missed = Some((now + MOVE_MAX, fault));
                }
                self.step(scene)
            }
            Look::Over => {
                self.climb = None;
                self.start_with(scene, winner)
            }
        }
    }

    fn start_with(&mut self, scene: &mut Scene<'_>, winner: Option<Trouble>) -> Option<Verdict> {
        let next = winner.or_else(|| self.missed.take().map(|(_, fault)| fault))?;
        self.start(scene, next)
    }

    fn start(&mut self, scene: &mut Scene<'_>, trouble: Trouble) -> Option<Verdict> {
        self.climb = Some(Climb::new(scene.now, trouble));
        self.step(scene)
    }

    /// Whether only a reset helps.
    pub(crate) fn is_latched(&self) -> bool {
        self.held.values().any(|held| held.latched)
    }

    /// Whether nothing is done for it, and the cause of `rule` is not given up.
    pub(crate) fn is_free_for(&self, rule: usize) -> bool {
        self.climb.is_none() && !self.is_latched() && !self.held.contains_key(&rule)
    }

    /// When it should be judged again at the latest.
    pub(crate) fn deadline(&self, now: Instant) -> Option<Instant> {
        let own = self.own.values().filter_map(|sustain| sustain.deadline(now));
        let climb = self.climb.as_ref().and_then(Climb::deadline);
        let held = self.held.values().filter_map(|held| held.until);
        let missed = self.missed.as_ref().map(|(due, _)| *due).filter(|due| *due > now);
        let counts = self.counts.falls_at().filter(|at| *at > now);
        own.chain(climb).chain(held).chain(missed).chain(counts).min()
    }

    /// Ends the holds that are over, and gives back the troubles that are to be tried again.
    fn leave_holds(&mut self, scene: &Scene<'_>) -> Vec<Trouble> {
        let now = scene.now;
        let settle = scene.policy.parts().limits.settle;
        let fault = scene.evidence.fault.is_some();
        let mut again = Vec::new();
        let Self { own, held, .. } = self;
        held.retain(|rule, hold| {
            if hold.latched {
                return true;
            }
            let condition = signs(own, scene, *rule).condition;
            let over = match condition {
                Some(stage) => !matches!(stage, Stage::Raised { .. }),
                // It ran again and failed again: somebody has reset it.
                None => fault && now >= hold.at + settle,
            };
            let room = hold.until.is_some_and(|until| now >= until);
            if room && !over && condition.is_none() {
                again.push(hold.trouble.clone());
            }
            !over && !room
        });
        again
    }

    /// The next order of the climb as a verdict.
    fn step(&mut self, scene: &mut Scene<'_>) -> Option<Verdict> {
        let climb = self.climb.as_mut()?;
        let rule = &rules(scene.policy)[climb.trouble.rule];
        if let Some(sustain) = sustain(&self.own, scene.robot, climb.trouble.rule) {
            climb.trouble.reason = condition_reason(sustain, scene.now);
        }
        let ladder = scene.policy.ladder(rule, self.actuator);
        let order = climb.step(
            scene.now,
            &mut Way {
                ladder,
                limits: &scene.policy.parts().limits,
                evidence: scene.evidence,
                restarts: &mut self.restarts,
                moves: scene.moves,
                patient: rule.is_of_robot(),
            },
        );
        let (cause, held_over_at) = (rule.cause, climb.trouble.held_over_at);
        let (remedy, note) = match order {
            Order::Try(remedy, note) => {
                self.missed = match remedy {
                    // Either way it is started anew.
                    Remedy::LocalStandby | Remedy::Restart { .. } => None,
                    Remedy::StandbyElsewhere | Remedy::LaunchElsewhere | Remedy::Hold => {
                        self.missed.take().map(|(_, fault)| (scene.now + MOVE_MAX, fault))
                    }
                };
                (remedy, note)
            }
            Order::Hold { note, until } => {
                let latched = ladder.rungs().first() == Some(&Rung::Hold);
                let trouble = self.climb.take()?.trouble;
                let reason = alloc::format!("{}{note}", trouble.reason);
                let held = Held { trouble, at: scene.now, until, latched };
                self.held.insert(held.trouble.rule, held);
                let component = scene.evidence.component.clone();
                return Some(Verdict {
                    component,
                    cause,
                    remedy: Remedy::Hold,
                    reason,
                    held_over_at,
                });
            }
        };
        let reason = alloc::format!("{}{note}", self.climb.as_ref()?.trouble.reason);
        let component = scene.evidence.component.clone();
        Some(Verdict { component, cause, remedy, reason, held_over_at })
    }
}

/// `rssi -54.8 dBm, bar -52.5 dBm, held 6.0 s`.
pub(crate) fn condition_reason(sustain: &Sustain, now: Instant) -> String {
    let condition = sustain.condition();
    let tenths = |time: Duration| {
        let tenths = time.as_millis() / 100;
        alloc::format!("{}.{}", tenths / 10, tenths % 10)
    };
    let held = match sustain.stage() {
        Stage::Calm => String::from("over"),
        Stage::Pending { since } => {
            let (held, hold) = (tenths(now.since(since)), tenths(condition.hold));
            alloc::format!("held {held} of {hold} s")
        }
        Stage::Raised { since, .. } => alloc::format!("held {} s", tenths(now.since(since))),
    };
    alloc::format!("{}, {held}", found_words(sustain, now))
}

/// `rssi -54.8 dBm, bar -52.5 dBm`, `exits 3 in 60.0 s, bar 3`, or what was told.
fn found_words(sustain: &Sustain, now: Instant) -> String {
    let condition = sustain.condition();
    let (fact, bar) = (condition.fact.label(), condition.bar.level());
    let found = match sustain.found(now) {
        Some(found) => alloc::format!("{found}"),
        None => String::from("unknown"),
    };
    match condition.fact.unit() {
        Unit::Flag => sustain.note.clone(),
        Unit::Rate => {
            let per = condition.per.as_secs_f64();
            alloc::format!("{fact} {found} in {per:.1} s, bar {bar}")
        }
        Unit::Memory | Unit::Share | Unit::Signal | Unit::Time => {
            alloc::format!("{fact} {found}, bar {bar}")
        }
    }
}

/// The watched condition of a rule, wherever it is kept.
pub(crate) fn sustain<'a>(
    own: &'a BTreeMap<usize, Sustain>,
    robot: &'a BTreeMap<usize, Sustain>,
    rule: usize,
) -> Option<&'a Sustain> {
    own.get(&rule).or_else(|| robot.get(&rule))
}

fn signs(own: &BTreeMap<usize, Sustain>, scene: &Scene<'_>, rule: usize) -> Signs {
    let condition = sustain(own, scene.robot, rule);
    Signs {
        fault: scene.evidence.fault.is_some(),
        condition: condition.map(Sustain::stage),
        raised_at: condition.and_then(Sustain::raised_at),
    }
}

fn is_fault(policy: &Policy, rule: usize) -> bool {
    rules(policy)[rule].trigger.condition().is_none()
}

fn first_severity(policy: &Policy, rule: usize, actuator: bool) -> u8 {
    let ladder = policy.ladder(&rules(policy)[rule], actuator);
    ladder.rungs().first().map_or(0, Rung::severity)
}

fn rules(policy: &Policy) -> &[Rule] {
    &policy.parts().rules
}
