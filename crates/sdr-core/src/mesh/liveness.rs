//! Who is alive: each observer's own judgement from the age of fresh news on any path.

use alloc::{collections::BTreeMap, vec::Vec};
use core::time::Duration;

use crate::{id::RobotId, time::Instant};

#[derive(Clone, Debug)]
struct Seen {
    fresh_at: Instant,
    alive: bool,
}

/// Ages of the last fresh news of all other robots.
#[derive(Clone, Debug)]
pub(super) struct Liveness {
    gone_after: Duration,
    seen: BTreeMap<RobotId, Seen>,
}

impl Liveness {
    pub(super) fn new(gone_after: Duration) -> Self {
        Self { gone_after, seen: BTreeMap::new() }
    }

    /// Fresh news of `robot`; whether it was not alive before.
    pub(super) fn hear(&mut self, robot: &RobotId, now: Instant) -> bool {
        let seen = Seen { fresh_at: now, alive: true };
        match self.seen.insert(robot.clone(), seen) {
            Some(before) => !before.alive,
            None => true,
        }
    }

    /// Robots that count as gone from now on.
    pub(super) fn judge(&mut self, now: Instant) -> Vec<RobotId> {
        let mut gone = Vec::new();
        for (robot, seen) in &mut self.seen {
            if seen.alive && now.since(seen.fresh_at) >= self.gone_after {
                seen.alive = false;
                gone.push(robot.clone());
            }
        }
        gone
    }

    /// News could not be heard for `pause`: no age grows by it.
    pub(super) fn forgive(&mut self, pause: Duration) {
        for seen in self.seen.values_mut() {
            seen.fresh_at = seen.fresh_at + pause;
        }
    }

    pub(super) fn is_alive(&self, robot: &RobotId) -> bool {
        self.seen.get(robot).is_some_and(|seen| seen.alive)
    }

    pub(super) fn age(&self, robot: &RobotId, now: Instant) -> Option<Duration> {
        self.seen.get(robot).map(|seen| now.since(seen.fresh_at))
    }

    pub(super) fn alive(&self) -> impl Iterator<Item = &RobotId> {
        self.seen.iter().filter(|(_, seen)| seen.alive).map(|(robot, _)| robot)
    }

    /// When the next robot would count as gone.
    pub(super) fn next_deadline(&self) -> Option<Instant> {
        let alive = self.seen.values().filter(|seen| seen.alive);
        alive.map(|seen| seen.fresh_at + self.gone_after).min()
    }
}
