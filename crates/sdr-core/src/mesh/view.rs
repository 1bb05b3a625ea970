//! What this robot's mesh believes of the others, when it is asked.

use core::time::Duration;

use super::{Inquiry, Mesh, Standing, author_table::Seat};
use crate::{id::RobotId, report::LinkReport, time::Instant, units::Permille};

impl Mesh {
    /// What is judged of `robot`; this robot itself is alive.
    pub fn standing(&self, robot: &RobotId) -> Standing {
        match self.authors.seat(robot) {
            Some(Seat::OWN) => Standing::Alive,
            Some(seat) => self.liveness.standing(seat),
            None => Standing::Unheard,
        }
    }

    /// Whether `robot` is alive or quiet; always so of this robot.
    pub fn is_alive(&self, robot: &RobotId) -> bool {
        matches!(self.standing(robot), Standing::Alive | Standing::Quiet)
    }

    /// Whether this robot hears nobody at all, though somebody was alive.
    pub fn is_isolated(&self) -> bool {
        self.liveness.is_isolated()
    }

    /// Whether some other robot held the very same fleet table at least once since the start:
    /// what this robot missed while it was away is known by now.
    pub fn is_in_step(&self) -> bool {
        self.in_step
    }

    /// Whether somebody who knows the same robots was heard since this one met its last new
    /// one: whoever is there is known by now.
    pub fn knows_the_same(&self) -> bool {
        self.repair.names_shared()
    }

    /// How long ago `robot` said the last that is known of it, by any path.
    pub fn age(&self, robot: &RobotId, now: Instant) -> Option<Duration> {
        match self.authors.seat(robot)? {
            Seat::OWN => Some(Duration::ZERO),
            seat => {
                let seen = self.liveness.get(seat)?;
                (seen.standing != Standing::Unheard).then(|| now.since(seen.fresh_at))
            }
        }
    }

    /// Whether another robot was heard without a relay in the last `within`.
    pub fn hears_somebody(&self, now: Instant, within: Duration) -> bool {
        let recent = |at: Instant| now.since(at) <= within;
        self.liveness.all().any(|(_, seen)| seen.direct_at.is_some_and(recent))
    }

    /// What came of the last [`Mesh::ask_about`] this robot, for ten seconds.
    pub fn inquiry(&self, robot: &RobotId) -> Option<Inquiry> {
        self.inquiries.get(robot)
    }

    /// The ages at which a robot is quiet and gone at present: as configured, or longer in a
    /// fleet where news usually takes longer.
    pub fn patience(&self) -> (Duration, Duration) {
        (self.liveness.quiet(), self.liveness.gone())
    }

    /// Other robots that are alive or quiet.
    pub fn alive(&self) -> impl Iterator<Item = &RobotId> {
        self.liveness.living().map(|(seat, _)| &self.authors.at(seat).robot)
    }

    /// How many other robots are alive or quiet.
    pub fn alive_count(&self) -> usize {
        self.liveness.living_count()
    }

    /// Robots that a link was measured to.
    pub fn linked(&self) -> impl Iterator<Item = &RobotId> {
        self.links.heard().map(|seat| &self.authors.at(seat).robot)
    }

    /// Links of this robot, measured by it.
    pub fn links(&self) -> impl Iterator<Item = (&RobotId, LinkReport)> {
        let reports = self.links.reports(self.clock, self.silent_after());
        reports.map(|(seat, report)| (&self.authors.at(seat).robot, report))
    }

    /// What was measured of the link to `robot`, as far as it was heard.
    pub fn link(&self, robot: &RobotId) -> Option<LinkReport> {
        let seat = self.authors.seat(robot)?;
        self.links.report(seat, self.clock, self.silent_after())
    }

    /// The loss on the way from `robot` to this one alone.
    pub fn loss_from(&self, robot: &RobotId) -> Option<Permille> {
        let seat = self.authors.seat(robot)?;
        self.links.loss_in(seat, self.clock, self.silent_after())
    }

    /// A living robot that was not heard directly for so long cannot be heard.
    fn silent_after(&self) -> Duration {
        let cycle = self.config.period * u32::try_from(self.authors.count()).unwrap_or(u32::MAX);
        (cycle * 6).max(self.config.gone_after / 2)
    }
}
