//! Everybody else's part: take what is offered, and take over from a holder that is silent.
//!
//! Rule 3 of the order: only with a third robot heard, when nobody asked has fresher news of
//! the holder, and with the own loop on time (the mesh moves its windows after a pause).

use alloc::format;

use super::Brain;
use crate::{
    fitness::Alone,
    id::RobotId,
    mesh::Standing,
    planted::{self, Defect},
    time::{Duration, Instant},
    units::Permille,
};

/// Answers to a question are waited for so long ...
const ANSWERS_FOR: Duration = Duration::from_millis(250);
/// ... or only so long, when all who were asked answered: time for three pings of the holder
/// itself, of which it hears and answers one in all but seven of a thousand cases where each
/// way loses a tenth.
const PINGED_FOR: Duration = Duration::from_millis(150);
/// Whoever could not take the role by then pings no more.
const PINGS_END: Duration = Duration::from_secs(1);
/// A question that nobody answered is asked again.
const ASK_AGAIN: Duration = Duration::from_millis(400);
/// While the holder is suspect it is looked at and pinged so often.
const LOOK_EVERY: Duration = Duration::from_millis(50);

/// The holder is silent for longer than usual.
#[derive(Clone, Debug)]
pub(super) struct Suspicion {
    holder: RobotId,
    since: Instant,
    looked_at: Instant,
}

impl Brain {
    /// Looks at the holder.
    pub(super) fn watch_holder(&mut self, now: Instant, holder: &RobotId) {
        if self.is_offered_here() {
            if self.may_stand(now) {
                let reason = self.succession().map(|said| said.reason.clone());
                self.take_role(&format!("from {holder}: {}", reason.unwrap_or_default()));
            }
            return;
        }
        let window = self.holder_window(holder);
        let silent = self.mesh.age(holder, now);
        // one that was never heard since the start gets the same time to speak
        let silent = silent.unwrap_or_else(|| now.since(self.started_at));
        if silent < window {
            self.desk_of_role.suspicion = None;
            self.wake_for_role(now + (window - silent));
            return;
        }
        self.suspect(now, holder, silent);
    }

    fn is_offered_here(&self) -> bool {
        self.succession().is_some_and(|said| said.offered_to.as_ref() == Some(&self.me))
    }

    /// How long the holder may be silent before it is suspect here: for its successors, who
    /// hear it directly, a few beats; for all others until it is quiet.
    fn holder_window(&self, holder: &RobotId) -> Duration {
        let (quiet_after, gone_after) = self.mesh.patience();
        if self.is_pair() {
            return gone_after;
        }
        match self.succession() {
            Some(said) if said.order.contains(&self.me) => {
                let loss = self.mesh.loss_from(holder).unwrap_or(Permille(0));
                said.beat * self.role_policy().misses_at(loss)
            }
            Some(_) | None => quiet_after,
        }
    }

    fn is_pair(&self) -> bool {
        self.mesh.authors().count() <= 2
    }

    fn suspect(&mut self, now: Instant, holder: &RobotId, silent: Duration) {
        if planted::is(Defect::RoleNeverTaken) {
            return;
        }
        self.wake_for_role(now + LOOK_EVERY);
        let known = self.desk_of_role.suspicion.clone().filter(|known| known.holder == *holder);
        let Some(suspicion) = known else {
            let fresh = Suspicion { holder: holder.clone(), since: now, looked_at: now };
            self.desk_of_role.suspicion = Some(fresh);
            self.mesh.ask_about(now, holder);
            self.mesh.ping(now, holder);
            return;
        };
        if now < suspicion.looked_at + LOOK_EVERY {
            return;
        }
        let turn = suspicion.since + self.role_policy().stagger * self.place_in_line();
        let near = now + PINGED_FOR >= turn && now < turn + PINGS_END;
        if near {
            self.mesh.ping(now, holder);
        }
        self.desk_of_role.suspicion = Some(Suspicion { looked_at: now, ..suspicion });
        let hasty = planted::is(Defect::RoleTakenByAll);
        let waits = now < turn && !hasty;
        if waits || !self.may_stand(now) || !(hasty || self.is_unheard(now, holder)) {
            return;
        }
        let since = self.desk_of_role.suspicion.as_ref().map(|suspicion| suspicion.since);
        self.desk_of_role.suspected_at = since;
        let text = format!("{holder} is silent for {} ms", silent.as_millis());
        self.take_role(&text);
    }

    /// Whether those who were asked know no more than this robot.
    fn is_unheard(&mut self, now: Instant, holder: &RobotId) -> bool {
        if self.is_pair() {
            let gone = matches!(self.mesh.standing(holder), Standing::Gone | Standing::Unheard);
            return gone && self.role_policy().alone == Alone::Promote;
        }
        if !self.has_witness() {
            return false;
        }
        let since = self.desk_of_role.suspicion.as_ref().map(|suspicion| suspicion.since);
        let inquiry = self.mesh.inquiry(holder);
        let Some(inquiry) = inquiry.filter(|one| since.is_some_and(|at| one.asked_at >= at)) else {
            self.mesh.ask_about(now, holder);
            return false;
        };
        let all = inquiry.answered >= inquiry.asked;
        let waited = now.since(inquiry.asked_at);
        if inquiry.answered == 0 && waited >= ASK_AGAIN {
            self.mesh.ask_about(now, holder);
        }
        inquiry.answered > 0 && waited >= if all { PINGED_FOR } else { ANSWERS_FOR }
    }

    /// How many are to try before this robot: as the holder named them, then by fitness.
    pub(super) fn place_in_line(&self) -> u32 {
        let named = self.succession().map(|said| said.order.clone()).unwrap_or_default();
        let place = match named.iter().position(|robot| *robot == self.me) {
            Some(place) => place,
            None => {
                let others = self.candidates();
                let mut unnamed = others.iter().filter(|robot| !named.contains(robot));
                named.len() + unnamed.position(|robot| *robot == self.me).unwrap_or(0)
            }
        };
        u32::try_from(place).unwrap_or(u32::MAX)
    }
}
