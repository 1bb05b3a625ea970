//! The coordinator role: who holds it, and how it is taken and told.
//!
//! The holder tells a few successors that it lives (`handover`); they, and later the others,
//! take over when it is silent (`takeover`). The record is (term, holder); the greater wins.

use alloc::{format, string::String, vec, vec::Vec};

use super::{Brain, handover::Holding, newborn::ALONE_AFTER, takeover::Suspicion};
use crate::{
    id::RobotId,
    mesh::FleetRecord,
    order::Version,
    planted::{self, Defect},
    record::{FleetValue, RecordKind, RoleRecord},
    report::{Report, SuccessionReport},
    time::{Duration, Instant},
};

/// News of another robot no older than two beats of the default gossip, with room for loss.
const HEARD_WITHIN: Duration = Duration::from_millis(2500);

/// A free role is looked at so often.
const STAND_EVERY: Duration = Duration::from_millis(100);
/// Each robot sees the others' links otherwise than they do: when those before it in line do
/// not take a free role, a robot does after so long for each of them.
const STAND_STAGGER: Duration = Duration::from_secs(2);

/// What this robot remembers of the role beside the record.
#[derive(Clone, Debug, Default)]
pub(super) struct RoleDesk {
    pub(super) holding: Option<Holding>,
    pub(super) suspicion: Option<Suspicion>,
    /// It holds the role and hears nobody.
    pub(super) suspended: bool,
    pub(super) wake_at: Option<Instant>,
    pub(super) stood_at: Option<Instant>,
    /// Since when it could take a role that nobody holds.
    pub(super) free_since: Option<Instant>,
    /// Why this robot takes the role, until it is on disk and said.
    pub(super) why: String,
}

impl Brain {
    pub(super) fn role(&self) -> Option<&RoleRecord> {
        match self.mesh.fleet().get(RecordKind::ROLE, "")? {
            (_, FleetValue::Role(role)) => Some(role),
            (_, _) => None,
        }
    }

    pub(super) fn term(&self) -> u64 {
        self.role().map_or(0, |role| role.term)
    }

    /// Whether this robot holds the role and may act on it.
    pub(super) fn is_coordinator(&self) -> bool {
        !self.desk_of_role.suspended && self.role().is_some_and(|role| role.holder == self.me)
    }

    pub(super) fn consider_role(&mut self, now: Instant) {
        if self.desk_of_role.wake_at.is_some_and(|at| now >= at) {
            self.desk_of_role.wake_at = None;
        }
        let holder = self.role().map(|role| role.holder.clone());
        if holder.as_ref() != Some(&self.me) {
            self.let_go();
        }
        match holder {
            Some(holder) if holder == self.me => self.hold(now),
            Some(holder) => self.watch_holder(now, &holder),
            None => self.stand(now),
        }
    }

    /// Nobody ever held the role, as far as is known here.
    fn stand(&mut self, now: Instant) {
        if self.desk_of_role.stood_at.is_some_and(|at| now < at + STAND_EVERY) {
            self.wake_for_role(now + STAND_EVERY);
            return;
        }
        self.desk_of_role.stood_at = Some(now);
        self.wake_for_role(now + STAND_EVERY);
        if !self.may_stand(now) || !self.has_witness() {
            return;
        }
        let since = *self.desk_of_role.free_since.get_or_insert(now);
        if self.is_first_choice() || now >= since + STAND_STAGGER * self.place_in_line() {
            let text = format!("fittest of {}", self.alive_robots().len());
            self.take_role(&text);
        }
    }

    fn is_first_choice(&self) -> bool {
        self.candidates().first() == Some(&self.me) || planted::is(Defect::RoleTakenByAll)
    }

    /// Takes the role under the next term.
    pub(super) fn take_role(&mut self, why: &str) {
        if !self.desk.is_minting() && !self.desk.is_broken() {
            self.desk_of_role.suspicion = None;
            let me = self.me.clone();
            let record = self.role_record(&me, false);
            self.desk_of_role.why = String::from(why);
            self.mint(vec![record], None);
        }
    }

    /// The role for `holder` under the next term.
    pub(super) fn role_record(&self, holder: &RobotId, by_operator: bool) -> FleetRecord {
        let term = self.number_after(RecordKind::ROLE, "", self.term());
        let fitness = self.fitness(holder).points;
        let value =
            FleetValue::Role(RoleRecord { holder: holder.clone(), term, fitness, by_operator });
        let version = Version { epoch: None, revision: 0, term, author: holder.clone() };
        FleetRecord::new(RecordKind::ROLE, String::new(), version, &value)
    }

    /// Rule 3: a robot speaks for another only when it hears somebody besides, unless the
    /// fleet is too small for that.
    pub(super) fn has_witness(&self) -> bool {
        // after the loss of a disk nobody is known yet, but those it is to begin with
        let seeds = self.config.seeds.iter().filter(|seed| Some(**seed) != self.config.listen);
        let known = self.mesh.authors().robots().count().max(seeds.count() + 1);
        known <= 2 || self.mesh.heard_directly(self.handled_at, HEARD_WITHIN) >= 1
    }

    /// Whether enough is known of the others to compare.
    pub(super) fn may_stand(&self, now: Instant) -> bool {
        if !self.may_hold(&self.me) || self.desk.is_minting() || self.desk.is_broken() {
            return false;
        }
        let others = self.config.seeds.iter().filter(|seed| Some(**seed) != self.config.listen);
        let all_heard = self.mesh.alive().count() >= others.count();
        // what this robot made before it lost its disk may still be known to others
        let since = now.since(self.started_at);
        let compared = !self.is_newborn() && (self.mesh.is_in_step() || since >= ALONE_AFTER);
        let known = || self.alive_robots().iter().all(|robot| self.facts(robot).is_some());
        compared && (since >= self.config.rejoin_wait || (all_heard && known()))
    }

    /// What the holder said of its succession, when it speaks of the present term.
    pub(super) fn succession(&self) -> Option<&SuccessionReport> {
        let role = self.role()?;
        let author = self.mesh.authors().author(&role.holder)?;
        let said = author.reports().find_map(|report| match report {
            Report::Succession(said) => Some(said),
            Report::Facts(_)
            | Report::Host(_)
            | Report::Link(..)
            | Report::Instance(_)
            | Report::Condition(_)
            | Report::Homeless(_)
            | Report::Stored(_) => None,
        });
        said.filter(|said| said.term == role.term)
    }

    pub(super) fn wake_for_role(&mut self, at: Instant) {
        let wake = &mut self.desk_of_role.wake_at;
        *wake = Some(wake.map_or(at, |before| before.min(at)));
    }

    /// Living robots that may follow the holder, the best first.
    pub(super) fn successors(&self) -> Vec<RobotId> {
        self.candidates().into_iter().filter(|robot| *robot != self.me).collect()
    }
}

#[expect(clippy::cast_precision_loss, reason = "terms are small")]
pub(super) fn count(term: u64) -> f64 {
    term as f64
}
