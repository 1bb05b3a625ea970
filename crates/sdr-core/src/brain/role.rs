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
    report::SuccessionReport,
    time::{Duration, Instant},
};

/// News of another robot no older than two beats of the default gossip, with room for loss.
const HEARD_WITHIN: Duration = Duration::from_millis(2500);

/// A free role is looked at so often.
const STAND_EVERY: Duration = Duration::from_millis(100);
/// A role that nobody holds is not taken before this robot knows the same robots as others
/// do, unless that takes longer than this since its start.
const STAND_AT_LAST: Duration = Duration::from_secs(30);
/// In larger fleets figures come by so slowly that each robot knows those of others.
const COMPARED_MAX: usize = 64;
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
    /// Since when its holder was suspect, when it is taken for that.
    pub(super) suspected_at: Option<Instant>,
    /// Why this robot takes the role, until it is on disk and said.
    pub(super) why: String,
}

impl Brain {
    pub(super) fn role(&self) -> Option<&RoleRecord> {
        self.mesh.fleet().role()
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
        let latest = now.since(self.started_at) >= STAND_AT_LAST;
        if !self.may_stand(now) || !self.has_witness() {
            return;
        }
        if !self.mesh.knows_the_same() && !latest && !planted::is(Defect::RoleTakenByAll) {
            return;
        }
        let since = *self.desk_of_role.free_since.get_or_insert(now);
        if self.is_first_choice() || now >= since + STAND_STAGGER * self.place_to_stand() {
            let text = format!("fittest of {}", self.alive_robots().len());
            self.take_role(&text);
        }
    }

    fn is_first_choice(&self) -> bool {
        self.place_to_stand() == 0 || planted::is(Defect::RoleTakenByAll)
    }

    /// How many are to take a role before this robot that nobody holds: the fitter ones, or
    /// in a large fleet, where the others' figures are not known yet, those with smaller names.
    /// A fitter one gets it from its holder later.
    fn place_to_stand(&self) -> u32 {
        if self.mesh.authors().count() <= COMPARED_MAX {
            return self.place_in_line();
        }
        let rank = |robot: &RobotId| (!self.prefers(robot), self.role_policy().pin(robot));
        let own = (rank(&self.me), &self.me);
        let unfit = self.fitness(&self.me).unfit.is_some();
        let others = self.mesh.alive().filter(|robot| self.may_hold(robot));
        let before = others.filter(|robot| unfit || (rank(robot), *robot) < own);
        u32::try_from(before.count()).unwrap_or(u32::MAX)
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
        let known = self.mesh.authors().count().max(self.seeds_of_others + 1);
        known <= 2 || self.mesh.hears_somebody(self.handled_at, HEARD_WITHIN)
    }

    /// Whether enough is known of the others to compare.
    pub(super) fn may_stand(&self, now: Instant) -> bool {
        if !self.may_hold(&self.me) || self.desk.is_minting() || self.desk.is_broken() {
            return false;
        }
        let all_heard = self.mesh.alive_count() >= self.seeds_of_others;
        // what this robot made before it lost its disk may still be known to others
        let since = now.since(self.started_at);
        let compared = !self.is_newborn() && (self.mesh.is_in_step() || since >= ALONE_AFTER);
        let known = || self.alive_robots().iter().all(|robot| self.facts(robot).is_some());
        compared && (since >= self.config.rejoin_wait || (all_heard && known()))
    }

    /// What the holder said of its succession, when it speaks of the present term.
    pub(super) fn succession(&self) -> Option<&SuccessionReport> {
        let role = self.role()?;
        let said = self.mesh.authors().author(&role.holder)?.succession();
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
