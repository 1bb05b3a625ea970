//! Epochs, terms and revisions never go back, also through restarts; what others hold of a
//! robot's making is on its disk; one version has one value.

use std::collections::{BTreeMap, BTreeSet};

use sdr_core::{
    mesh::{FleetRecord, FleetTable},
    order::{Version, hash64},
    record::{FleetKey, FleetValue, RecordKind},
};

use crate::sim::{Broken, Checker, Fleet, Sight};

/// Kinds that carry an order.
const ORDERED: [RecordKind; 3] = [RecordKind::SYSTEM, RecordKind::ASSIGNMENT, RecordKind::ROLE];
/// More records than this, over all robots, are not looked at one by one.
const RECORDS_MAX: usize = 20_000;

/// `order-went-back`, `wire-before-disk`, `version-twice`.
#[derive(Debug, Default)]
pub struct Orders {
    /// By robot: the start of its agent, and the records it held then.
    held: BTreeMap<usize, (u64, BTreeMap<FleetKey, FleetRecord>)>,
    /// By robot: its life and the hash of its table at the last look; an equal one holds
    /// nothing new.
    roots: BTreeMap<usize, (u64, u64)>,
    /// Robots that lost a disk: others may rightly hold more of their making than they.
    forgetful: BTreeSet<usize>,
    /// The value under each version ever seen of a home or the role.
    values: BTreeMap<(FleetKey, Version), u64>,
}

impl Checker for Orders {
    fn watch(&mut self, fleet: &Fleet, sight: &Sight) -> Option<Broken> {
        if let Sight::On { robot, disk_kept } = sight {
            let first = fleet.robots[*robot].life() == 1;
            if !disk_kept && !first {
                self.forgetful.insert(*robot);
            }
            let answers = *disk_kept && !self.forgetful.contains(robot);
            return answers.then(|| wire_before_disk(fleet, *robot)).flatten();
        }
        if matches!(sight, Sight::Off { .. }) && fleet.remembers_nothing() {
            self.values.clear();
        }
        let robots = 0..fleet.robots.len();
        let tables = robots.clone().filter_map(|robot| fleet.table(robot));
        let few = || tables.map(FleetTable::len).sum::<usize>() <= RECORDS_MAX;
        if !matches!(sight, Sight::Look) || !few() {
            return None;
        }
        robots.into_iter().find_map(|robot| self.look(fleet, robot))
    }
}

impl Orders {
    fn look(&mut self, fleet: &Fleet, robot: usize) -> Option<Broken> {
        let life = fleet.robots[robot].life();
        let root = (life, fleet.table(robot)?.root());
        if self.roots.insert(robot, root) == Some(root) {
            return None;
        }
        let now: BTreeMap<FleetKey, FleetRecord> =
            records(fleet, robot).map(|record| (record.key.clone(), record.clone())).collect();
        let (then, before) = self.held.insert(robot, (life, now.clone())).unwrap_or_default();
        let is_back = |record: &&FleetRecord| match now.get(&record.key) {
            Some(now) => now.version < record.version,
            None => !is_buried(fleet, robot, record),
        };
        let back = before.values().filter(|_| then == life).find(is_back);
        if let Some(FleetRecord { key, version, .. }) = back {
            let what = format!("robot-{} held {} {version:?}", robot + 1, key.name);
            return Some(Broken::new("order-went-back", what));
        }
        records(fleet, robot).find_map(|record| self.value_of(record))
    }

    fn value_of(&mut self, record: &FleetRecord) -> Option<Broken> {
        if record.key.kind == RecordKind::SYSTEM || is_by_operator(record) {
            return None;
        }
        let value = hash64(&record.value);
        let name = (record.key.clone(), record.version.clone());
        let before = *self.values.entry(name).or_insert(value);
        (before != value).then(|| {
            let what = format!("two values of {} {:?}", record.key.name, record.version);
            Broken::new("version-twice", what)
        })
    }
}

/// Whether an operator named this holder of the role: the record is made by the robot that was
/// asked, and its author stands for the holder. Holder and term are all of its order, and a
/// holder may take the same term by itself meanwhile.
fn is_by_operator(record: &FleetRecord) -> bool {
    let value = FleetValue::decode(record.key.kind, &record.value);
    matches!(value, Ok(FleetValue::Role(role)) if role.by_operator)
}

fn records(fleet: &Fleet, robot: usize) -> impl Iterator<Item = &FleetRecord> {
    let table = fleet.table(robot).into_iter();
    table.flat_map(|table| {
        let keys = ORDERED.into_iter().flat_map(|kind| table.of_kind(kind));
        keys.filter_map(|(key, _, _)| table.record(key))
    })
}

/// Whether a standby chose itself under a number that its disk holds as used: it says so
/// before the record is on disk (rule 4 of the order).
fn is_reserved(fleet: &Fleet, robot: usize, record: &FleetRecord) -> bool {
    let Some(epoch) = &record.version.epoch else { return false };
    let (0, Ok(FleetValue::Assignment(assignment))) =
        (record.version.revision, FleetValue::decode(record.key.kind, &record.value))
    else {
        return false;
    };
    let stored = fleet.robots[robot].disk.held();
    let reserved = stored.and_then(|stored| stored.epochs.get(&assignment.component));
    let here = assignment.home == fleet.robots[robot].id;
    here && reserved.is_some_and(|reserved| epoch.number <= *reserved)
}

/// Whether a robot dropped a record because everybody knew its system to be undeployed.
fn is_buried(fleet: &Fleet, robot: usize, record: &FleetRecord) -> bool {
    let value = FleetValue::decode(record.key.kind, &record.value);
    let (Some(table), Ok(value)) = (fleet.table(robot), value) else { return false };
    table.is_buried(&record.key, &record.version, &value)
}

/// What a robot made and others hold must be on its own disk.
fn wire_before_disk(fleet: &Fleet, robot: usize) -> Option<Broken> {
    let me = &fleet.robots[robot].id;
    let own = fleet.table(robot)?;
    let others = (0..fleet.robots.len()).filter(|other| *other != robot).take(50);
    for other in others {
        let mine = records(fleet, other);
        let mine = mine.filter(|record| record.version.author == *me && !is_by_operator(record));
        for record in mine.filter(|record| !is_reserved(fleet, robot, record)) {
            let lacks = own.record(&record.key).is_none_or(|own| own.version < record.version);
            if lacks && !is_buried(fleet, robot, record) {
                let what = format!(
                    "robot-{} holds {} {:?}, which {me} made and has not on its disk",
                    other + 1,
                    record.key.name,
                    record.version
                );
                return Some(Broken::new("wire-before-disk", what));
            }
        }
    }
    None
}
