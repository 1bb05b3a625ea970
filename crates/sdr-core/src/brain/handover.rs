//! The holder's part: it beats to its successors, offers the role to a better one while it
//! still talks, and rests when it hears nobody.

use alloc::{collections::BTreeMap, format, string::String, vec::Vec};

use super::{Brain, role::count};
use crate::{
    event::Event,
    id::RobotId,
    mesh::{AuthorKey, BeatsFor, Push},
    report::{Report, SuccessionReport},
    time::{Duration, Instant},
};

/// Successors that hear of the holder directly.
const SUCCESSORS_MAX: usize = 2;
/// The holder compares itself with the others so often.
const COMPARE_EVERY: Duration = Duration::from_millis(500);
/// Trouble must stand for so long: a single bad figure moves nothing.
const TROUBLE_FOR: Duration = Duration::from_secs(1);
/// Who does not take what it is offered within this time is passed over.
const OFFER_FOR: Duration = Duration::from_secs(3);

/// What the holder remembers.
#[derive(Clone, Debug)]
pub(super) struct Holding {
    term: u64,
    compared_at: Option<Instant>,
    order: Vec<RobotId>,
    /// Who would be better, why, since when.
    better: Option<(RobotId, Instant)>,
    offer: Option<Offer>,
}

#[derive(Clone, Debug)]
struct Offer {
    to: RobotId,
    since: Instant,
    reason: String,
}

/// Why the role should go elsewhere.
struct Better {
    robot: RobotId,
    wait: Duration,
    reason: String,
}

impl Brain {
    /// The holder's turn.
    pub(super) fn hold(&mut self, now: Instant) {
        self.rest_or_resume();
        let term = self.term();
        let fresh =
            || Holding { term, compared_at: None, order: Vec::new(), better: None, offer: None };
        let held = self.desk_of_role.holding.take().filter(|holding| holding.term == term);
        let mut holding = match held {
            Some(holding) => holding,
            None => {
                self.say_taken(term);
                fresh()
            }
        };
        let next = holding.compared_at.map(|at| at + COMPARE_EVERY);
        if next.is_none_or(|at| now >= at) {
            holding.compared_at = Some(now);
            if !self.desk_of_role.suspended {
                self.compare(now, &mut holding);
            }
            self.tell_succession(&mut holding);
        }
        self.wake_for_role(holding.compared_at.map_or(now, |at| at + COMPARE_EVERY));
        self.desk_of_role.holding = Some(holding);
    }

    /// It acts from here on: its term is on disk and in the table.
    fn say_taken(&mut self, term: u64) {
        let why = core::mem::take(&mut self.desk_of_role.why);
        let by_operator = self.role().is_some_and(|role| role.by_operator);
        let why = match (why.is_empty(), by_operator) {
            (false, _) => why,
            (true, true) => String::from("named by an operator"),
            (true, false) => String::from("held it before"),
        };
        let event = Event::new("role-taken", &self.me, format!("term {term}, {why}"));
        let mut event = event.number("term", count(term));
        if let Some(since) = self.desk_of_role.suspected_at.take() {
            let suspect = self.handled_at.since(since).as_millis();
            event = event.number("suspect_ms", count(u64::try_from(suspect).unwrap_or(0)));
        }
        self.push_event(event);
    }

    /// It does not hold the role, or not any more.
    pub(super) fn let_go(&mut self) {
        self.desk_of_role.suspended = false;
        if self.desk_of_role.holding.take().is_some() {
            self.mesh.beat_to(BeatsFor::Succession, BTreeMap::new());
            self.mesh.retract(&AuthorKey::succession());
        }
    }

    /// A holder that hears nobody decides nothing for others: they may have another by now.
    fn rest_or_resume(&mut self) {
        let others = self.mesh.authors().count() > 2;
        let isolated = others && self.mesh.is_isolated();
        if isolated != self.desk_of_role.suspended {
            self.desk_of_role.suspended = isolated;
            let (kind, text) = match isolated {
                true => ("role-suspended", "hears nobody: decides nothing for others"),
                false => ("role-resumed", "hears others again and is still the holder"),
            };
            let event = Event::new(kind, &self.me, text).number("term", count(self.term()));
            self.push_event(event);
        }
    }

    /// Sees whether somebody else should have the role, and offers it.
    fn compare(&mut self, now: Instant, holding: &mut Holding) {
        let refused = holding.offer.take_if(|offer| now >= offer.since + OFFER_FOR);
        let passed_over = refused.as_ref().map(|offer| &offer.to);
        let Some(better) = self.better_holder(passed_over) else {
            holding.better = None;
            holding.offer = None;
            return;
        };
        let since = match &holding.better {
            Some((robot, since)) if *robot == better.robot => *since,
            Some(_) | None => now,
        };
        holding.better = Some((better.robot.clone(), since));
        let offered = holding.offer.as_ref().is_some_and(|offer| offer.to == better.robot);
        if now < since + better.wait || offered {
            return;
        }
        let text = format!("to {}: {}", better.robot, better.reason);
        let event = Event::new("role-offered", &self.me, text);
        self.push_event(event.number("term", count(holding.term)));
        holding.offer = Some(Offer { to: better.robot, since: now, reason: better.reason });
    }

    /// Who should have the role instead of this robot.
    fn better_holder(&self, passed_over: Option<&RobotId>) -> Option<Better> {
        let policy = self.role_policy();
        let candidates = self.candidates();
        // nobody gets the role for what is not known of it
        let known = |robot: &&RobotId| self.figures_of(robot).is_some();
        let mut others = candidates.iter().filter(|robot| **robot == self.me || known(robot));
        let best = others.find(|robot| Some(*robot) != passed_over)?;
        if *best == self.me {
            return None;
        }
        let (mine, other) = (self.fitness(&self.me), self.fitness(best));
        let by_operator = self.role().is_some_and(|role| role.by_operator);
        let robot = best.clone();
        if !self.may_hold(&self.me) {
            let reason = String::from("this robot may not hold it");
            return Some(Better { robot, wait: Duration::ZERO, reason });
        }
        if let (Some(reason), None) = (mine.unfit, other.unfit) {
            return Some(Better { robot, wait: TROUBLE_FOR, reason });
        }
        let place = |robot: &RobotId| (!self.prefers(robot), policy.pin(robot));
        let ahead = other.points.saturating_sub(mine.points);
        let reason = match place(best) < place(&self.me) {
            true => String::from("it is preferred"),
            false if ahead >= policy.margin => {
                format!("{} points against {}", other.points, mine.points)
            }
            false => return None,
        };
        (!by_operator).then_some(Better { robot, wait: policy.margin_for, reason })
    }

    /// Says who follows, and to whom the role is offered; beats to them.
    fn tell_succession(&mut self, holding: &mut Holding) {
        let policy = self.role_policy();
        let (beat, misses) = (policy.beat, policy.misses);
        let mut order = self.successors();
        order.truncate(SUCCESSORS_MAX);
        if order != holding.order {
            let beats = order.iter().map(|robot| (robot.clone(), beat)).collect();
            self.mesh.beat_to(BeatsFor::Succession, beats);
            holding.order.clone_from(&order);
        }
        let offer = holding.offer.as_ref();
        let report = SuccessionReport {
            term: holding.term,
            order,
            beat,
            misses,
            offered_to: offer.map(|offer| offer.to.clone()),
            reason: offer.map(|offer| offer.reason.clone()).unwrap_or_default(),
        };
        self.mesh.report(&Report::Succession(report), Push::Now);
    }
}
