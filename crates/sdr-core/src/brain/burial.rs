//! Rule 6: a tombstone is dropped only when every robot on the roster has acknowledged it.
//!
//! Every robot says which fleet table its disk holds; when all of them hold the coordinator's,
//! it draws a horizon. Until then nothing that was undeployed is forgotten, so a robot that is
//! lost for good keeps the tombstones in the table until it is taken off the roster.

use alloc::{collections::BTreeSet, string::String, vec, vec::Vec};

use super::Brain;
use crate::{
    event::Event,
    id::RobotId,
    mesh::{AuthorKey, FleetRecord, Push},
    order::Version,
    planted::{self, Defect},
    record::{FleetValue, RecordKind},
    report::{Report, StoredReport},
    time::{Duration, Instant},
};

/// Between two burials; undeploying is rare, and each changes everybody's table.
const BURY_EVERY: Duration = Duration::from_secs(10);
/// Most bytes of names in a report; a larger fleet keeps its tombstones.
const NAMES_BYTES_MAX: usize = 800;

/// What this robot knows of disks.
#[derive(Clone, Debug, Default)]
pub(super) struct Burial {
    /// Every robot ever heard of, this one included.
    roster: BTreeSet<RobotId>,
    /// Hash of the fleet table that is on its way to the disk, and of the one that is there.
    pub(super) root_in_flight: Option<u64>,
    pub(super) root_stored: Option<u64>,
    said: Option<u64>,
    /// How many robots were heard when names were ordered to the disk last.
    heard: usize,
    buried_at: Option<Instant>,
}

impl Burial {
    pub(super) fn new(known: BTreeSet<RobotId>) -> Self {
        Self { roster: known, ..Self::default() }
    }
}

impl Brain {
    /// Every robot that this one ever heard of, itself among them.
    fn roster(&self) -> BTreeSet<RobotId> {
        self.burial.roster.iter().chain(self.mesh.authors().robots()).cloned().collect()
    }

    /// Names for the disk: all of them when somebody is new.
    pub(super) fn robots_to_store(&mut self, whole: bool) -> Vec<RobotId> {
        let heard = self.mesh.authors().count();
        let new = whole || heard != self.burial.heard;
        self.burial.heard = heard;
        if new { self.roster().into_iter().collect() } else { Vec::new() }
    }

    /// Hash of the table that an order brings to the disk; `None` when the two differ: something
    /// made here is on its way, or an edition still arrives.
    pub(super) fn root_to_store(&self) -> Option<u64> {
        let same = !self.desk.is_minting() && !self.editions.are_arriving();
        same.then(|| self.mesh.fleet().root())
    }

    /// Says what is on this robot's disk, while others may wait for it.
    pub(super) fn say_stored(&mut self) {
        let waits = self.mesh.fleet().tombstones().next().is_some();
        let root = self.burial.root_stored.filter(|_| waits);
        if root == self.burial.said {
            return;
        }
        self.burial.said = root;
        let robots = self.roster();
        let bytes: usize = robots.iter().map(|robot| robot.as_str().len() + 1).sum();
        match root.filter(|_| bytes <= NAMES_BYTES_MAX) {
            Some(root) => {
                let robots = robots.into_iter().collect();
                let report = Report::Stored(StoredReport { root, robots });
                self.mesh.report(&report, Push::WithGossip);
            }
            None => self.mesh.retract(&AuthorKey::stored()),
        }
    }

    /// The coordinator buries what everybody knows to be dead.
    pub(super) fn consider_burial(&mut self, now: Instant) {
        let rests = self.burial.buried_at.is_some_and(|at| now < at + BURY_EVERY);
        let Some(root) = self.burial.root_stored.filter(|_| !rests) else { return };
        if root != self.mesh.fleet().root() || !self.is_held_by_all(root) {
            return;
        }
        let Some(horizon) = self.mesh.fleet().next_horizon() else { return };
        self.burial.buried_at = Some(now);
        let known = self.mesh.fleet().get(RecordKind::HORIZON, "");
        let known = known.map_or(0, |(version, _)| version.revision);
        let revision = self.number_after(RecordKind::HORIZON, "", known);
        let text = alloc::format!(
            "what was undeployed up to revision {} is on every disk",
            horizon.revision
        );
        self.push_event(Event::new("tombstones-dropped", &self.me, text));
        let version = Version { epoch: None, revision, term: self.term(), author: self.me.clone() };
        let value = FleetValue::Horizon(horizon);
        let record = FleetRecord::new(RecordKind::HORIZON, String::new(), version, &value);
        self.mint(vec![record], None);
    }

    /// Whether every robot that anybody ever heard of has this very table on its disk.
    fn is_held_by_all(&self, root: u64) -> bool {
        let mut roster = self.roster();
        let mut holders = BTreeSet::from([self.me.clone()]);
        for robot in self.roster() {
            let Some(said) = self.stored_of(&robot) else { continue };
            roster.extend(said.robots.iter().cloned());
            if said.root == root {
                holders.insert(robot);
            }
        }
        // who lost its disk may not know of somebody who is away
        let complete = self.mesh.has_heard_seeds()
            && holders.iter().any(|robot| self.mesh.remembers_all(robot));
        (complete && roster.is_subset(&holders)) || planted::is(Defect::BuriedTooSoon)
    }

    fn stored_of(&self, robot: &RobotId) -> Option<&StoredReport> {
        self.mesh.authors().author(robot)?.reports().find_map(|report| match report {
            Report::Stored(stored) => Some(stored),
            Report::Facts(_)
            | Report::Host(_)
            | Report::Link(..)
            | Report::Instance(_)
            | Report::Condition(_)
            | Report::Succession(_)
            | Report::Homeless(_) => None,
        })
    }
}
