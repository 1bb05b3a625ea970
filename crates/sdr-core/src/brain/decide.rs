//! The coordinator's part: who has no home, who should leave, whose home is gone.

use alloc::{
    boxed::Box,
    collections::{BTreeMap, BTreeSet},
    format,
    string::{String, ToString},
    sync::Arc,
    vec::Vec,
};

use super::{
    Brain,
    plans::{Asked, Purpose},
    problem::{Asking, Avoid, Place},
    systems::SystemNow,
};
use crate::{
    allocate::{AllocError, Plan, Tier},
    effect::Effect,
    event::Event,
    id::{ComponentKey, Name, RobotId},
    input::PlanId,
    lifecycle::LifecycleState,
    recover::{Cause, Remedy},
    report::ConditionReport,
    spec::ComponentSpec,
    time::Instant,
};

impl Brain {
    pub(super) fn decide(&mut self, now: Instant) {
        if !self.is_coordinator() || self.desk.is_minting() || self.desk.is_broken() {
            return;
        }
        self.plans.give_up_late(now);
        self.advance_moves(now);
        self.consider_burial(now);
        if self.desk.is_minting() || self.plans.asked.is_some() || !self.may_begin(now) {
            return;
        }
        for system in self.systems_to_look_at(now) {
            if self.ask_for_orphans(now, &system)
                || self.ask_for_leavers(now, &system)
                || self.ask_for_homeless(now, &system)
                || self.ask_for_standbys(now, &system)
            {
                return;
            }
        }
    }

    /// Systems with a home that is gone, a call for help, or a component without a home or
    /// without a standby that it wishes for.
    fn systems_to_look_at(&mut self, now: Instant) -> Vec<Arc<SystemNow>> {
        let authors = self.mesh.authors();
        let tells = |robot: &RobotId| {
            authors.author(robot).is_some_and(|author| author.conditions().next().is_some())
        };
        self.index.troubled.retain(tells);
        let gone = self.index.absent.iter().filter(|home| self.is_gone(home, now));
        let mut names: BTreeSet<&Name> =
            gone.flat_map(|home| self.index.at(home)).map(|key| &key.system).collect();
        names.extend(self.index.unplaced());
        names.extend(self.index.backed.iter().map(|key| &key.system));
        names.extend(self.conditions_told().map(|(_, condition)| &condition.system));
        names.into_iter().filter_map(|name| self.systems.get(name).cloned()).collect()
    }

    /// What living robots say of their trouble, by robot.
    fn conditions_told(&self) -> impl Iterator<Item = (&RobotId, &ConditionReport)> {
        let robots = self.index.troubled.iter().filter(|robot| self.mesh.is_alive(robot));
        robots.flat_map(|robot| {
            let author = self.mesh.authors().author(robot).into_iter();
            author.flat_map(move |author| author.conditions().map(move |told| (robot, told)))
        })
    }

    fn ask_for_orphans(&mut self, now: Instant, system: &SystemNow) -> bool {
        let purpose = Purpose::Rehome { reason: String::new() };
        if !self.has_witness() || !self.plans.is_due(&system.name, &purpose, now) {
            return false;
        }
        let orphans = self.missed_orphans(now, &system.name);
        let Some((_, reason)) = orphans.first() else { return false };
        let purpose = Purpose::Rehome { reason: reason.clone() };
        let avoid = self.avoid(now, system, &names_of(&orphans));
        let (backed, bare): (Vec<_>, Vec<_>) =
            orphans.into_iter().partition(|(key, _)| self.best_standby(key, &avoid).is_some());
        if !backed.is_empty() {
            self.succeed_gone(&backed, &avoid);
            return true;
        }
        self.ask(now, system, &names_of(&bare), purpose)
    }

    /// Components that a robot wants to be rid of, one robot and cause at a time.
    fn ask_for_leavers(&mut self, now: Instant, system: &SystemNow) -> bool {
        for (from, condition) in self.calls_for_help(&system.name) {
            let leaves = |name: &&Name| {
                self.wanted(&system.key(name)).is_some_and(|(_, assignment)| {
                    assignment.home == from && assignment.target.is_none()
                })
            };
            let names: Vec<Name> = condition.components.iter().filter(leaves).cloned().collect();
            let (cause, reason) = (condition.cause, condition.reason.clone());
            // a standby that runs already is the answer, and nothing has to be foreseen for it
            let avoid = self.avoid(now, system, &names);
            let backed = |name: &Name| self.best_standby(&system.key(name), &avoid).is_some();
            let (backed, names): (Vec<Name>, Vec<Name>) = names.into_iter().partition(backed);
            if !backed.is_empty() && !condition.foreseen {
                self.move_to_standbys(now, system, &backed, (&from, &condition), &avoid);
                return true;
            }
            let purpose = match condition.foreseen {
                true => Purpose::Prepare { from, cause, reason },
                false => Purpose::Move { from, cause, reason },
            };
            if !names.is_empty() && self.ask(now, system, &names, purpose) {
                return true;
            }
        }
        false
    }

    fn ask_for_homeless(&mut self, now: Instant, system: &SystemNow) -> bool {
        let homeless = |spec: &&Arc<ComponentSpec>| self.home(&system.key(&spec.name)).is_none();
        let names: Vec<Name> =
            system.components.iter().filter(homeless).map(|spec| spec.name.clone()).collect();
        !names.is_empty() && self.ask(now, system, &names, Purpose::Deploy)
    }

    /// Conditions of living robots that call for another home.
    pub(super) fn calls_for_help(&self, system: &Name) -> Vec<(RobotId, ConditionReport)> {
        let elsewhere = |condition: &ConditionReport| match condition.remedy {
            Remedy::StandbyElsewhere | Remedy::LaunchElsewhere => true,
            Remedy::LocalStandby | Remedy::Restart { .. } | Remedy::Hold => false,
        };
        let calls = self.conditions_told();
        let calls = calls.filter(|(_, told)| told.system == *system && elsewhere(told));
        calls.map(|(robot, told)| (robot.clone(), told.clone())).collect()
    }

    /// Asks the allocator, when the time for this question has come.
    pub(super) fn ask(
        &mut self,
        now: Instant,
        system: &SystemNow,
        names: &[Name],
        purpose: Purpose,
    ) -> bool {
        if !self.plans.is_due(&system.name, &purpose, now) {
            return false;
        }
        let (tier, place) = match purpose {
            Purpose::Deploy => (Tier::Strict, Place::Given),
            Purpose::Standby(_) => (Tier::Strict, Place::Kept),
            Purpose::Move { .. } | Purpose::Prepare { .. } | Purpose::Rehome { .. } => {
                (Tier::Relaxed, Place::Given)
            }
        };
        let mut avoid = self.avoid(now, system, names);
        if let Purpose::Standby(side) = purpose {
            self.avoid_shared_fate(system, side, &mut avoid);
        }
        let problem = self.problem(system, &Asking { names, tier, place, avoid: &avoid });
        if problem.robots.is_empty() {
            return false;
        }
        let plan = self.plans.next_id();
        let versions = names
            .iter()
            .map(|name| {
                let key = system.key(name);
                let version = self.assignment(&key).map(|(version, _)| version.clone());
                (key, version)
            })
            .collect();
        self.plans.asked =
            Some(Asked { plan, at: now, system: system.name.clone(), purpose, versions });
        self.effects.push_back(Effect::Plan { plan, problem: Box::new(problem) });
        true
    }

    /// Robots a component must not go to: those that are in trouble of their own, and those
    /// it left not long ago, unless it runs nowhere and no other could take it.
    pub(super) fn avoid(
        &self,
        now: Instant,
        system: &SystemNow,
        names: &[Name],
    ) -> BTreeMap<Name, Avoid> {
        let mut avoid: BTreeMap<Name, Avoid> = BTreeMap::new();
        let calls = self.calls_for_help(&system.name);
        let ill = self.ill_robots(system);
        for name in names {
            let list = avoid.entry(name.clone()).or_default();
            list.extend(ill.iter().cloned());
            for (robot, condition) in &calls {
                let robot_wide = !super::conditions::is_event(condition.cause);
                if robot_wide || condition.components.contains(name) {
                    list.push((robot.clone(), condition.cause.to_string()));
                }
            }
            let key = system.key(name);
            let stranded = self.is_stranded(&key);
            for ((of, robot), until) in &self.left {
                if *of == key && now < *until && !stranded {
                    list.push((robot.clone(), String::from("left it not long ago")));
                }
            }
        }
        avoid
    }

    /// Whether a component runs nowhere, and the last answer named no robot that could take it.
    fn is_stranded(&self, key: &ComponentKey) -> bool {
        let runs = self.home(key).and_then(|home| self.instance_report(home, key));
        let runs = runs.is_some_and(|report| report.state == LifecycleState::Active);
        !runs && self.plans.refusals.contains_key(key)
    }

    /// Robots on which the system's own recovery would act at once.
    fn ill_robots(&self, system: &SystemNow) -> Avoid {
        let Some(engine) = self.make_engine(&system.recovery) else { return Avoid::new() };
        let robots = self.alive_robots().into_iter();
        let ill = robots.filter_map(|robot| {
            let (_, reason) = engine.recovery().objection(&self.figures_of(&robot)?)?;
            Some((robot, reason))
        });
        ill.collect()
    }

    pub(super) fn handle_planned(
        &mut self,
        now: Instant,
        plan: PlanId,
        result: Result<Plan, AllocError>,
    ) {
        let Some(asked) = self.plans.asked.take_if(|asked| asked.plan == plan) else { return };
        self.plans.answered(&asked, result.as_ref().ok(), now);
        let stale = asked.versions.iter().any(|(key, version)| {
            self.assignment(key).map(|(version, _)| version) != version.as_ref()
        });
        if stale || !self.is_coordinator() || !self.systems.contains_key(&asked.system) {
            self.plans.retry_soon();
            return;
        }
        match result {
            Ok(plan) => self.adopt(now, &asked, &plan),
            Err(error) => self.event("plan-failed", format!("{}: {error}", asked.system)),
        }
    }

    fn adopt(&mut self, now: Instant, asked: &Asked, plan: &Plan) {
        if let Purpose::Standby(_) = asked.purpose {
            return self.back_up(now, asked, plan);
        }
        let foreseen = matches!(asked.purpose, Purpose::Prepare { .. });
        // nothing is missed yet of what is only foreseen, so nothing is said of it
        for homeless in plan.homeless.iter().filter(|_| !foreseen) {
            let refusals: Vec<String> = homeless.refusals.iter().map(ToString::to_string).collect();
            if self.say_homeless(homeless) {
                self.event_about("homeless", &homeless.component, refusals.join("; "));
            }
        }
        for placement in &plan.placements {
            self.unsay_homeless(&placement.component);
            let reason = placed_reason(asked, placement);
            let event = Event::new("placed", &self.me, reason).about(&placement.component);
            #[expect(clippy::cast_precision_loss, reason = "memory stays below 2^53 bytes")]
            let left = placement.memory_left.0 as f64;
            let mut event = event.number("memory_left_bytes", left);
            event.reason = format!("on {}: {}", placement.robot, event.reason);
            self.push_event(event);
        }
        match &asked.purpose {
            Purpose::Deploy | Purpose::Rehome { .. } => self.assign(asked, plan),
            Purpose::Move { .. } => self.begin_move(now, asked, plan),
            Purpose::Prepare { .. } => self.prepare(now, asked, plan),
            Purpose::Standby(_) => {}
        }
    }
}

fn names_of(orphans: &[(ComponentKey, String)]) -> Vec<Name> {
    orphans.iter().map(|(key, _)| key.name.clone()).collect()
}

/// Why a component leaves; the rest of its reason stands behind it.
pub(super) fn leaving_reason(from: &RobotId, cause: Cause, reason: &str) -> String {
    format!("from {from}, {cause}: {reason}; ")
}

/// Why a component goes where it goes.
pub(super) fn placed_reason(asked: &Asked, placement: &crate::allocate::Placement) -> String {
    let mut reason = match &asked.purpose {
        Purpose::Deploy => String::new(),
        Purpose::Standby(_) => String::from("standby; "),
        Purpose::Move { from, cause, reason } | Purpose::Prepare { from, cause, reason } => {
            leaving_reason(from, *cause, reason)
        }
        Purpose::Rehome { reason } => format!("{reason}; "),
    };
    if placement.refusals.is_empty() {
        reason.push_str("first that fits");
    } else {
        let refusals: Vec<String> = placement.refusals.iter().map(ToString::to_string).collect();
        reason.push_str(&refusals.join("; "));
    }
    reason.push_str(&format!("; {} left", placement.memory_left));
    if placement.tier == Tier::Relaxed {
        reason.push_str(" (relaxed tier)");
    }
    let end = reason.char_indices().nth(280).map_or(reason.len(), |(at, _)| at);
    reason.truncate(end);
    reason
}
