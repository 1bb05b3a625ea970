//! Tombstones of the fleet table: systems that were undeployed, and when nobody needs to
//! remember it any more.

use alloc::{string::String, vec::Vec};

use super::fleet_table::{FleetTable, RECORDS_MAX, system_of_part};
use crate::{
    order::Version,
    planted::{self, Defect},
    record::{FleetKey, FleetValue, HorizonRecord, RecordKind},
};

impl FleetTable {
    /// Systems that were undeployed, with the revision that did so.
    pub fn tombstones(&self) -> impl Iterator<Item = (&str, u64)> {
        self.dead.iter().filter_map(|name| {
            let (version, _) = self.get(RecordKind::SYSTEM, name)?;
            Some((name.as_str(), version.revision))
        })
    }

    /// Whether a record belongs to a system that was undeployed and forgotten by all.
    pub fn is_buried(&self, key: &FleetKey, version: &Version, value: &FleetValue) -> bool {
        let Some(horizon) = self.horizon() else { return false };
        match value {
            FleetValue::System(_) => horizon.buries(&key.name, version.revision),
            FleetValue::Assignment(home) => {
                horizon.buries(home.component.system.as_str(), home.deployment)
            }
            FleetValue::Component(_)
            | FleetValue::Connection(_)
            | FleetValue::Allocation(_)
            | FleetValue::Recovery(_)
            | FleetValue::Role(_)
            | FleetValue::RolePolicy(_)
            | FleetValue::Horizon(_)
            | FleetValue::Unknown => {
                system_of_part(key).is_some_and(|of| horizon.buries(of, version.revision))
            }
        }
    }

    /// The horizon that would bury all tombstones; `None` when there is nothing to bury, or too
    /// much that must survive.
    pub fn next_horizon(&self) -> Option<HorizonRecord> {
        self.tombstones().next()?;
        // never back: what was buried before stays buried
        let revision = self.revision_floor();
        let mut survivors: Vec<u32> = self
            .of_kind(RecordKind::SYSTEM)
            .filter(|(_, _, value)| matches!(value, FleetValue::System(system) if system.wanted))
            .map(|(key, _, _)| HorizonRecord::word(&key.name))
            .collect();
        survivors.sort_unstable();
        let epoch = self.epoch_floor();
        let fits = survivors.len() <= HorizonRecord::SURVIVORS_MAX;
        fits.then_some(HorizonRecord { revision, epoch, survivors })
    }

    /// Revisions of a system that is not wanted now begin above this.
    pub fn revision_floor(&self) -> u64 {
        let buried = self.horizon().map_or(0, |horizon| horizon.revision);
        self.tombstones().map(|(_, revision)| revision).fold(buried, u64::max)
    }

    /// Epochs of a component that has no home now begin above this.
    pub fn epoch_floor(&self) -> u64 {
        let buried = self.horizon().map_or(0, |horizon| horizon.epoch);
        let dead = self.tombstones().flat_map(|(system, _)| {
            let mut prefix = String::from(system);
            prefix.push('/');
            self.epochs_below(&prefix)
        });
        dead.fold(buried, u64::max)
    }

    /// Whether so many records more would be taken.
    pub fn has_room_for(&self, records: usize) -> bool {
        self.len() + records <= RECORDS_MAX
    }

    fn epochs_below(&self, prefix: &str) -> Vec<u64> {
        let homes = self.below(RecordKind::ASSIGNMENT, prefix);
        homes.filter_map(|(_, version, _)| Some(version.epoch.as_ref()?.number)).collect()
    }

    /// Drops what a new horizon buries. Records that were never here may be dropped, too: a
    /// robot that was away so long that nobody counts on it any more holds nothing alive.
    pub(super) fn bury(&mut self) {
        let buried: Vec<FleetKey> = self
            .records()
            .filter(|(record, value)| self.is_buried(&record.key, &record.version, value))
            .map(|(record, _)| record.key.clone())
            .collect();
        buried.iter().for_each(|key| self.drop_fact(key));
    }

    /// What no table may do: see [`Defect::TombstoneDropped`].
    pub(super) fn drop_tombstones(&mut self) {
        if !planted::is(Defect::TombstoneDropped) {
            return;
        }
        let name = |name: &str| FleetKey { kind: RecordKind::SYSTEM, name: String::from(name) };
        let dead: Vec<FleetKey> = self.tombstones().map(|(system, _)| name(system)).collect();
        dead.iter().for_each(|key| self.drop_fact(key));
    }
}
