//! Rule 10: a planned silence of an agent suspends the guards over what runs there.

use alloc::{collections::BTreeMap, format};

use super::Brain;
use crate::{
    id::RobotId,
    report::{HoldReport, Report},
    time::{Duration, Instant},
};

/// Planned silences of others, and how often this robot announced one.
#[derive(Clone, Debug, Default)]
pub(super) struct Holds {
    announced: u32,
    /// The life and the count that were taken note of last, and until when guards wait.
    heard: BTreeMap<RobotId, ((u64, u32), Instant)>,
}

impl Brain {
    /// Tells others that this agent is away for a moment.
    pub(super) fn announce_hold(&mut self, time: Duration) {
        let time = time.min(HoldReport::TIME_MAX);
        self.holds.announced += 1;
        let hold = HoldReport { time, count: self.holds.announced };
        self.mesh.report(&Report::Hold(hold), crate::mesh::Push::Now);
        self.event("hold-announced", format!("away for at most {} ms", time.as_millis()));
    }

    /// Takes note of a planned silence; the same one counts once, however often it is heard.
    pub(super) fn note_hold(&mut self, now: Instant, robot: &RobotId) {
        let Some(author) = self.mesh.authors().author(robot) else { return };
        let hold = author.reports().find_map(|report| match report {
            Report::Hold(hold) => Some(*hold),
            Report::Facts(_)
            | Report::Host(_)
            | Report::Link(..)
            | Report::Instance(_)
            | Report::Condition(_)
            | Report::Homeless(_)
            | Report::Succession(_) => None,
        });
        let Some(hold) = hold else { return };
        let which = (author.incarnation().counter, hold.count);
        if self.holds.heard.get(robot).is_none_or(|(known, _)| *known < which) {
            let until = now + hold.time.min(HoldReport::TIME_MAX);
            self.holds.heard.insert(robot.clone(), (which, until));
            self.event("hold-heard", format!("{robot} is away for {} ms", hold.time.as_millis()));
        }
    }

    /// Until when guards over what runs on `robot` wait, whatever they miss; `None` when it
    /// announced no silence, or that is over.
    pub(super) fn held_until(&self, now: Instant, robot: &RobotId) -> Option<Instant> {
        let (_, until) = self.holds.heard.get(robot)?;
        Some(*until).filter(|until| now < *until)
    }
}
