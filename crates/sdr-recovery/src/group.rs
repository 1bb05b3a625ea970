//! Components that are judged by the same rules: fresh evidence in, what should be done now
//! out.

use alloc::{collections::BTreeMap, format, string::String, vec::Vec};
use core::time::Duration;

use sdr_core::{
    id::ComponentKey,
    recover::{
        Cause, CauseStatus, Evidence, Fault, Foresight, Remedy, RemedyOutcome, RobotEvidence,
        Verdict,
    },
    time::Instant,
};

use crate::{
    budget::Budget,
    climb::Trouble,
    fact::Fact,
    ladder::Rung,
    level::Unit,
    policy::{Policy, Rule},
    sustain::{Stage, Sustain},
    watch::{Scene, Watch, condition_reason, sustain},
};

/// Longest reason of a fault that is passed on, in characters.
const REASON_MAX: usize = 200;

/// The components of one system that have the same rules.
#[derive(Debug)]
pub(crate) struct Group {
    policy: Policy,
    /// Conditions of the robot, by rule: shared, so that all components leave together.
    robot: BTreeMap<usize, Sustain>,
    watches: BTreeMap<ComponentKey, Watch>,
    /// Moves are remembered when their component has left, so that it cannot be thrown back
    /// and forth for ever.
    moves: BTreeMap<ComponentKey, Budget>,
    judged_at: Instant,
}

impl Group {
    /// At rest.
    pub(crate) fn new(policy: Policy) -> Self {
        Self {
            policy,
            robot: BTreeMap::new(),
            watches: BTreeMap::new(),
            moves: BTreeMap::new(),
            judged_at: Instant::ZERO,
        }
    }

    fn feed(&mut self, now: Instant, evidence: &[Evidence]) {
        // Nothing is known of the robot of a component that is gone.
        let here = evidence.iter().find(|one| !is_gone(one));
        for (index, rule) in self.policy.parts().rules.iter().enumerate() {
            let Some(condition) = rule.trigger.condition().filter(|one| one.fact.is_shared())
            else {
                continue;
            };
            if let Some(here) = here {
                let sustain = self.robot.entry(index).or_insert_with(|| Sustain::new(condition));
                sustain.feed(now, condition.fact.read(here, condition.over));
            }
        }
        for one in evidence {
            let watch = self.watches.entry(one.component.clone()).or_default();
            watch.feed(now, one, &self.policy.parts().rules);
        }
    }

    /// Whose turn it is for a raised cause of the robot that is first met here, one component
    /// after the other: the largest that nothing else is done for. Nobody's while one climbs.
    fn turn<'a>(&self, rule: usize, evidence: &'a [Evidence]) -> Option<&'a Evidence> {
        let sustain = self.robot.get(&rule).filter(|sustain| sustain.raised())?;
        if !self.is_one_by_one(&self.policy.parts().rules[rule]) {
            return None;
        }
        let watch = |one: &Evidence| self.watches.get(&one.component);
        let climbs = |one: &Evidence| {
            let climb = watch(one).and_then(|watch| watch.climb.as_ref());
            climb.is_some_and(|climb| climb.trouble.rule == rule)
        };
        let free = |one: &&Evidence| {
            watch(one).is_some_and(|watch| watch.is_free_for(rule)) && !is_gone(one)
        };
        let by_cpu = sustain.condition().fact == Fact::RobotCpu;
        let size = |one: &Evidence| if by_cpu { u64::from(one.cpu.0) } else { one.memory.0 };
        if evidence.iter().any(climbs) {
            return None;
        }
        evidence.iter().filter(free).min_by_key(|one| (u64::MAX - size(one), &one.component))
    }

    /// A cause of the robot whose ladder begins here: freeing one component may be enough.
    fn is_one_by_one(&self, rule: &Rule) -> bool {
        match self.policy.ladder(rule, false).rungs().first() {
            Some(Rung::LocalStandby | Rung::Restart(_)) => rule.is_of_robot(),
            Some(Rung::StandbyElsewhere | Rung::LaunchElsewhere | Rung::Hold) | None => false,
        }
    }

    /// Causes that stand for a component now, but those that go by turns.
    fn troubles(&self, now: Instant, one: &Evidence) -> Vec<Trouble> {
        let trouble = |(index, rule): (usize, &Rule)| {
            if rule.trigger.condition().is_some() {
                let by_turns = self.robot.contains_key(&index) && self.is_one_by_one(rule);
                return if by_turns { None } else { self.condition_trouble(now, one, index) };
            }
            let fault = one.fault.as_ref().filter(|fault| fault.cause == rule.cause)?;
            let reason = fault_reason(fault);
            Some(Trouble { rule: index, since: now, held_over_at: now, reason })
        };
        self.policy.parts().rules.iter().enumerate().filter_map(trouble).collect()
    }

    /// The condition of a rule, when it is raised and its figure is known for the component.
    fn condition_trouble(&self, now: Instant, one: &Evidence, rule: usize) -> Option<Trouble> {
        let seen = sustain(&self.watches.get(&one.component)?.own, &self.robot, rule)?;
        let condition = seen.condition();
        let fact = condition.fact;
        let is_read = fact.unit() != Unit::Rate && fact.unit() != Unit::Flag;
        // What is counted or told stays known; a figure may be unknown for this component.
        let known = !is_read || fact.read(one, condition.over).is_some();
        let known = known && !is_gone(one);
        let held_over_at = seen.held_over_at().filter(|_| known)?;
        let since = held_over_at - condition.hold;
        Some(Trouble { rule, since, held_over_at, reason: condition_reason(seen, now) })
    }

    /// Whether a condition that is not raised yet will send a component away, and how.
    fn foresee(&self, component: &ComponentKey, watch: &Watch, index: usize) -> Option<Foresight> {
        let parts = self.policy.parts();
        let rule = &parts.rules[index];
        let seen = sustain(&watch.own, &self.robot, index)?;
        let Stage::Pending { since } = seen.stage() else { return None };
        let remedy = match self.policy.ladder(rule, watch.actuator).rungs().first()? {
            Rung::StandbyElsewhere => Remedy::StandbyElsewhere,
            Rung::LaunchElsewhere => Remedy::LaunchElsewhere,
            Rung::LocalStandby | Rung::Restart(_) | Rung::Hold => return None,
        };
        let hold = seen.condition().hold;
        let wait = hold * parts.limits.prepare_after.0 / 1000;
        let held = self.judged_at.since(since);
        let moves = self.moves.get(component);
        let may_move = moves.is_none_or(|moves| {
            moves.clone().has_room(self.judged_at, parts.limits.moves_per_hour)
        });
        (held >= wait && wait < hold && may_move && watch.is_free_for(index)).then(|| Foresight {
            component: component.clone(),
            cause: rule.cause,
            remedy,
            hold,
            reason: condition_reason(seen, self.judged_at),
        })
    }

    fn judge_one(&mut self, now: Instant, one: &Evidence, troubles: Vec<Trouble>) -> Vec<Verdict> {
        let Some(watch) = self.watches.get_mut(&one.component) else {
            return Vec::new();
        };
        let moves = self.moves.entry(one.component.clone()).or_default();
        let (policy, robot) = (&self.policy, &self.robot);
        watch.judge(&mut Scene { now, policy, robot, evidence: one, moves }, troubles)
    }
}

impl Group {
    pub(crate) fn judge(&mut self, now: Instant, evidence: &[Evidence]) -> Vec<Verdict> {
        self.judged_at = now;
        if evidence.is_empty() {
            // Nobody tells how the robot is, so nothing is known of the time until somebody does.
            self.robot.clear();
        }
        self.feed(now, evidence);
        let mut verdicts = Vec::new();
        for one in evidence {
            let troubles = self.troubles(now, one);
            verdicts.extend(self.judge_one(now, one, troubles));
        }
        for rule in 0..self.policy.parts().rules.len() {
            if let Some(one) = self.turn(rule, evidence) {
                let troubles = self.condition_trouble(now, one, rule).into_iter().collect();
                verdicts.extend(self.judge_one(now, one, troubles));
            }
        }
        self.moves.retain(|_, moves| !moves.is_idle(now));
        verdicts
    }

    pub(crate) fn outcome(
        &mut self,
        now: Instant,
        component: &ComponentKey,
        outcome: RemedyOutcome,
    ) {
        let Some(watch) = self.watches.get_mut(component) else {
            return;
        };
        let Some(climb) = &mut watch.climb else {
            return;
        };
        let parts = self.policy.parts();
        let rule = &parts.rules[climb.trouble.rule];
        let ladder = self.policy.ladder(rule, watch.actuator);
        let number = climb.trouble.rule;
        let moved = climb.outcome(now, outcome, (ladder, &parts.limits, rule.is_of_robot()));
        if outcome == RemedyOutcome::Done {
            // What happened before the remedy says nothing of what it did.
            watch.count_anew(number);
        }
        if moved {
            watch.missed = None;
            let moves = self.moves.entry(component.clone()).or_default();
            moves.spend(now, parts.limits.moves_per_hour);
        }
    }

    pub(crate) fn forget(&mut self, component: &ComponentKey) {
        let Some(watch) = self.watches.remove(component) else {
            return;
        };
        if let Some(climb) = watch.climb {
            let parts = self.policy.parts();
            let ladder = self.policy.ladder(&parts.rules[climb.trouble.rule], watch.actuator);
            if climb.is_leaving(ladder) {
                let moves = self.moves.entry(component.clone()).or_default();
                moves.spend(self.judged_at, parts.limits.moves_per_hour);
            }
        }
        if self.watches.is_empty() {
            self.robot.clear();
        }
    }

    pub(crate) fn next_deadline(&self) -> Option<Instant> {
        // What was not shown in the last call could not act on its deadline either.
        let due = |watch: &Watch| {
            let deadline = watch.deadline(self.judged_at);
            deadline.filter(|at| watch.seen_at == self.judged_at || *at > self.judged_at)
        };
        let robot = self.robot.values().filter_map(|sustain| sustain.deadline(self.judged_at));
        let robot = robot.filter(|at| *at > self.judged_at);
        robot.chain(self.watches.values().filter_map(due)).min()
    }

    pub(crate) fn standing(&self) -> Vec<CauseStatus> {
        let mut standing = Vec::new();
        for (component, watch) in &self.watches {
            for (index, rule) in self.policy.parts().rules.iter().enumerate() {
                let (component, cause) = (component.clone(), rule.cause);
                let status = match sustain(&watch.own, &self.robot, index) {
                    Some(seen) => condition_status(seen, self.judged_at),
                    None => fault_status(watch, index),
                };
                if let Some((since, hold, raised, reason)) = status {
                    let status = CauseStatus { component, cause, since, hold, raised, reason };
                    standing.push(status);
                }
            }
        }
        standing
    }

    pub(crate) fn foreseen(&self) -> Vec<Foresight> {
        let mut foreseen = Vec::new();
        for (component, watch) in &self.watches {
            let of = |rule| self.foresee(component, watch, rule);
            foreseen.extend((0..self.policy.parts().rules.len()).filter_map(of));
        }
        foreseen
    }

    /// The rules and bounds.
    pub(crate) fn policy(&self) -> &Policy {
        &self.policy
    }

    pub(crate) fn is_latched(&self, component: &ComponentKey) -> bool {
        self.watches.get(component).is_some_and(Watch::is_latched)
    }

    pub(crate) fn objection(&self, robot: &RobotEvidence) -> Option<(Cause, String)> {
        self.policy.parts().rules.iter().find_map(|rule| {
            let condition = rule.trigger.condition()?;
            let found = condition.fact.read_robot(robot, condition.over)?;
            let bar = condition.bar;
            bar.holds(found.raw()).then(|| {
                let (fact, bar) = (condition.fact.label(), bar.level());
                (rule.cause, format!("{}: {fact} {found}, bar {bar}", rule.cause))
            })
        })
    }
}

fn condition_status(seen: &Sustain, now: Instant) -> Option<(Instant, Duration, bool, String)> {
    let (since, raised) = match seen.stage() {
        Stage::Calm => return None,
        Stage::Pending { since } => (since, false),
        Stage::Raised { since, .. } => (since, true),
    };
    Some((since, seen.condition().hold, raised, condition_reason(seen, now)))
}

/// A fault stands as long as it is climbed for or held.
fn fault_status(watch: &Watch, rule: usize) -> Option<(Instant, Duration, bool, String)> {
    let climb = watch.climb.as_ref().map(|climb| &climb.trouble);
    let held = watch.held.get(&rule).map(|held| &held.trouble);
    let trouble = climb.filter(|trouble| trouble.rule == rule).or(held)?;
    Some((trouble.since, Duration::ZERO, true, trouble.reason.clone()))
}

fn fault_reason(fault: &Fault) -> String {
    match fault.reason.trim() {
        "" => fault.cause.word().into(),
        reason => reason.chars().take(REASON_MAX).collect(),
    }
}

fn is_gone(evidence: &Evidence) -> bool {
    evidence.fault.as_ref().is_some_and(|fault| fault.cause == Cause::RobotGone)
}
