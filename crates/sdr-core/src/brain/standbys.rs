//! Standbys between robots: how many there are, where they belong, who takes over.
//!
//! The coordinator lists them in the assignment, in order of succession; each robot reads there
//! what to keep ready. The order is used by `guard` at once and by the coordinator in `decide`.

use alloc::{
    collections::BTreeMap,
    format,
    string::{String, ToString},
    vec::Vec,
};

use super::{
    Brain,
    decide::{leaving_reason, placed_reason},
    moves::{MoveWatch, Old, record},
    plans::{Asked, Purpose, Side},
    problem::Avoid,
    systems::SystemNow,
};
use crate::{
    allocate::{Homeless, Plan},
    event::Event,
    id::{ComponentKey, Name, RobotId},
    lifecycle::LifecycleState,
    mesh::FleetRecord,
    record::Assignment,
    report::ConditionReport,
    spec::{ComponentSpec, StandbyKind, StandbyWhere},
    time::{Duration, Instant},
};

/// Two coordinators that know different things would undo each other's lists as fast as they
/// can write, and drown the news that tells them: each waits so long before it does it again.
const RIVAL_PAUSE: Duration = Duration::from_secs(3);

impl Brain {
    pub(super) fn spec_of(&self, key: &ComponentKey) -> Option<&ComponentSpec> {
        self.systems.get(&key.system)?.component(&key.name)
    }

    pub(super) fn stands_by_hot(&self, key: &ComponentKey) -> bool {
        self.spec_of(key).is_some_and(|spec| spec.standby.kind == StandbyKind::Hot)
    }

    /// Robots beside the home on which an instance should be ready.
    pub(super) fn keeps_instances(&self, key: &ComponentKey) -> impl Iterator<Item = &RobotId> {
        let hot = self.stands_by_hot(key);
        let wanted = self.wanted(key).map(|(_, assignment)| assignment);
        wanted.into_iter().flat_map(move |assignment| {
            assignment
                .others()
                .filter(move |robot| hot || assignment.target.as_ref() == Some(robot))
        })
    }

    /// Standbys on other robots that could take over now, in order of succession.
    pub(super) fn ready_standbys(&self, key: &ComponentKey) -> Vec<RobotId> {
        let hot = self.stands_by_hot(key);
        let wanted = self.wanted(key).map(|(_, assignment)| assignment);
        let others = wanted.into_iter().flat_map(|assignment| {
            assignment.standbys.iter().filter(|robot| **robot != assignment.home)
        });
        let ready = others.filter(|robot| {
            let ready = || {
                self.instance_report(robot, key)
                    .is_some_and(|report| report.ready && report.state == LifecycleState::Inactive)
            };
            self.mesh.is_alive(robot) && (!hot || ready())
        });
        ready.cloned().collect()
    }

    /// The first standby that could take over and that nothing speaks against.
    pub(super) fn best_standby(
        &self,
        key: &ComponentKey,
        avoid: &BTreeMap<Name, Avoid>,
    ) -> Option<RobotId> {
        let bad = |robot: &RobotId| {
            avoid.get(&key.name).is_some_and(|list| list.iter().any(|(ill, _)| ill == robot))
        };
        self.ready_standbys(key).into_iter().find(|robot| !bad(robot))
    }

    /// Components leave a robot that still works for standbys that run already.
    pub(super) fn move_to_standbys(
        &mut self,
        now: Instant,
        system: &SystemNow,
        names: &[Name],
        (from, condition): (&RobotId, &ConditionReport),
        avoid: &BTreeMap<Name, Avoid>,
    ) {
        let mut records = Vec::new();
        for key in names.iter().map(|name| system.key(name)) {
            let Some(standby) = self.best_standby(&key, avoid) else { continue };
            let why = leaving_reason(from, condition.cause, &condition.reason);
            let reason = format!("{why}standby on {standby}");
            let hot = self.stands_by_hot(&key);
            let record = match hot {
                true => self.new_home(&key, &standby, reason.clone(), Old::Drains),
                false => self.with_target(&key, &standby, &reason),
            };
            let Some(record) = record else { continue };
            let epoch = record.version.epoch.clone().filter(|_| hot);
            self.left.insert((key.clone(), from.clone()), now + self.not_back_for(&key));
            self.moves.insert(key.clone(), MoveWatch::started(now, from, epoch));
            self.event_about("move-started", &key, format!("{from} -> {standby}: {reason}"));
            records.push(record);
        }
        self.mint_some(records);
    }

    /// Standbys become homes of components whose home is gone.
    pub(super) fn succeed_gone(
        &mut self,
        orphans: &[(ComponentKey, String)],
        avoid: &BTreeMap<Name, Avoid>,
    ) {
        let mut records = Vec::new();
        for (key, reason) in orphans {
            let Some(standby) = self.best_standby(key, avoid) else { continue };
            let reason = format!("{reason}; standby on {standby}");
            self.event_about("placed", key, format!("on {standby}: {reason}"));
            records.extend(self.new_home(key, &standby, reason, Old::Stops));
        }
        self.mint_some(records);
    }

    /// Asks for standbys that are wished for and not there; true when something was done.
    pub(super) fn ask_for_standbys(&mut self, now: Instant, system: &SystemNow) -> bool {
        self.listed.retain(|_, at| now < *at + RIVAL_PAUSE);
        let keys = system.keys().filter(|key| self.index.backed.contains(key));
        let keys: Vec<ComponentKey> = keys.filter(|key| self.may_list(system, key)).collect();
        if self.tidy_standbys(now, &keys) {
            return true;
        }
        for side in [Side::OtherRobot, Side::SameRobot] {
            let lacking = keys.iter().filter(|key| self.lacks_standby(key, side));
            let names: Vec<Name> = lacking.map(|key| key.name.clone()).collect();
            if !names.is_empty() && self.ask(now, system, &names, Purpose::Standby(side)) {
                return true;
            }
        }
        false
    }

    /// Whether this robot knows enough to list standbys of a component: its edition is that of
    /// the list, or a newer one, and nobody just undid what it listed.
    fn may_list(&self, system: &SystemNow, key: &ComponentKey) -> bool {
        self.wanted(key).is_some_and(|(version, assignment)| {
            let undone = version.author != self.me && self.listed.contains_key(key);
            assignment.deployment <= system.revision && !undone
        })
    }

    /// The assignment of a component with other standbys.
    fn with_standbys(&self, key: &ComponentKey, standbys: Vec<RobotId>) -> Option<FleetRecord> {
        let (version, assignment) = self.wanted(key)?;
        let deployment = self.systems.get(&key.system)?.revision;
        let value = Assignment { standbys, deployment, ..assignment.clone() };
        Some(record(key, self.next_revision(key, version), value))
    }

    /// Whether a running component wishes for one more standby on that side.
    fn lacks_standby(&self, key: &ComponentKey, side: Side) -> bool {
        let (Some(spec), Some((_, assignment))) = (self.spec_of(key), self.wanted(key)) else {
            return false;
        };
        let missing = assignment.standbys.len() < usize::from(spec.standby.count);
        let here = assignment.stands_by_at_home();
        let side_fits = match (spec.standby.place, side) {
            (StandbyWhere::SameRobot, Side::SameRobot) => !here,
            (StandbyWhere::OtherRobot | StandbyWhere::Any, Side::OtherRobot) => true,
            // where no other robot can take it
            (StandbyWhere::Any, Side::SameRobot) => !here && self.unbacked.contains_key(key),
            (StandbyWhere::SameRobot, Side::OtherRobot)
            | (StandbyWhere::OtherRobot, Side::SameRobot) => false,
        };
        let home = &assignment.home;
        let active = || {
            self.instance_report(home, key)
                .is_some_and(|report| report.state == LifecycleState::Active)
        };
        missing && side_fits && assignment.target.is_none() && self.mesh.is_alive(home) && active()
    }

    /// Strikes out standbys that are gone or not wished for any more.
    fn tidy_standbys(&mut self, now: Instant, keys: &[ComponentKey]) -> bool {
        let mut records: Vec<FleetRecord> = Vec::new();
        for key in keys {
            let Some((_, assignment)) = self.wanted(key) else { continue };
            let proper = self.proper_standbys(now, key, assignment);
            if proper != assignment.standbys {
                records.extend(self.with_standbys(key, proper));
                self.listed.insert(key.clone(), now);
            }
        }
        self.mint_some(records)
    }

    fn proper_standbys(
        &self,
        now: Instant,
        key: &ComponentKey,
        assignment: &Assignment,
    ) -> Vec<RobotId> {
        let Some(spec) = self.spec_of(key) else { return Vec::new() };
        let fits = |robot: &&RobotId| match spec.standby.place {
            StandbyWhere::SameRobot => **robot == assignment.home,
            StandbyWhere::OtherRobot => **robot != assignment.home,
            StandbyWhere::Any => true,
        };
        let stays = |robot: &&RobotId| !self.is_gone(robot, now);
        let proper = assignment.standbys.iter().filter(fits).filter(stays);
        proper.take(usize::from(spec.standby.count)).cloned().collect()
    }

    /// Robots that would share the fate of the home, or of another standby.
    pub(super) fn avoid_shared_fate(
        &self,
        system: &SystemNow,
        side: Side,
        avoid: &mut BTreeMap<Name, Avoid>,
    ) {
        let robots = self.alive_robots();
        for (name, list) in avoid {
            let key = system.key(name);
            let (Some(spec), Some((_, assignment))) = (self.spec_of(&key), self.wanted(&key))
            else {
                continue;
            };
            let home = &assignment.home;
            list.extend(robots.iter().filter_map(|robot| {
                let reason = match side {
                    Side::SameRobot if robot == home => return None,
                    Side::SameRobot => format!("the standby belongs on {home}"),
                    Side::OtherRobot if robot == home => String::from("its home is here"),
                    Side::OtherRobot if assignment.standbys.contains(robot) => {
                        String::from("a standby is here already")
                    }
                    Side::OtherRobot => {
                        let word = self.shared_label(robot, home, &spec.standby.apart)?;
                        format!("has {word} like its home {home}")
                    }
                };
                Some((robot.clone(), reason))
            }));
        }
    }

    /// A label of one of these kinds (`rack` for `rack=2`) that two robots have in common.
    fn shared_label(&self, robot: &RobotId, home: &RobotId, kinds: &[String]) -> Option<String> {
        let (here, there) = (self.facts(robot)?, self.facts(home)?);
        let counts = |label: &&String| {
            let kind = label.split_once('=').map(|(kind, _)| kind);
            kinds.iter().any(|wanted| *label == wanted || kind == Some(wanted.as_str()))
        };
        let shared = here.labels.iter().filter(counts).find(|label| there.labels.contains(label));
        shared.cloned()
    }

    /// Lists what the allocator found, and says what it did not find.
    pub(super) fn back_up(&mut self, now: Instant, asked: &Asked, plan: &Plan) {
        for homeless in &plan.homeless {
            self.say_unbacked(homeless);
        }
        let mut records = Vec::new();
        for placement in &plan.placements {
            let key = &placement.component;
            self.unbacked.remove(key);
            let Some((_, assignment)) = self.wanted(key) else { continue };
            let mut standbys = assignment.standbys.clone();
            standbys.push(placement.robot.clone());
            records.extend(self.with_standbys(key, standbys));
            self.listed.insert(key.clone(), now);
            let text = format!("on {}: {}", placement.robot, placed_reason(asked, placement));
            self.event_about("standby-placed", key, text);
        }
        self.mint_some(records);
    }

    fn say_unbacked(&mut self, homeless: &Homeless) {
        let refusals = homeless.refusals.clone();
        let known = self.unbacked.insert(homeless.component.clone(), refusals);
        if known.as_ref() != Some(&homeless.refusals) {
            let words: Vec<String> = homeless.refusals.iter().map(ToString::to_string).collect();
            self.event_about("standby-missing", &homeless.component, words.join("; "));
        }
    }

    /// Who stands by once `home` is the home.
    pub(super) fn standbys_after(
        &self,
        key: &ComponentKey,
        home: &RobotId,
        old: Old,
    ) -> Vec<RobotId> {
        let Some((_, before)) = self.wanted(key) else { return Vec::new() };
        let gone = |robot: &RobotId| old == Old::Stops && *robot == before.home;
        let stays = |robot: &&RobotId| **robot != *home && **robot != before.home && !gone(robot);
        before.standbys.iter().filter(stays).cloned().collect()
    }

    /// Mints what there is; false when that is nothing.
    fn mint_some(&mut self, records: Vec<FleetRecord>) -> bool {
        let any = !records.is_empty();
        if any {
            self.mint(records, None);
        }
        any
    }

    /// The event of a component that goes on elsewhere.
    pub(super) fn event_of_promotion(&self, key: &ComponentKey, text: String) -> Event {
        Event::new("promoted", &self.me, text).about(key)
    }
}
