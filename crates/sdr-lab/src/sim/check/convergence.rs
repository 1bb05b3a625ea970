//! After the faults: each wanted component active exactly once, where its assignment says;
//! one coordinator whom all know; equal tables; every connection carries the latest token.

use std::collections::BTreeSet;

use sdr_core::{
    brain::Brain,
    id::{ComponentKey, RobotId},
    lifecycle::LifecycleState,
    mesh::FleetTable,
    order::Token,
    record::{FleetValue, RecordKind},
};

use crate::sim::{Fleet, same_table};

/// Records compared byte by byte; of larger fleets the first robots stand for all.
const RECORDS_MAX: usize = 100_000;
/// Robots of a large fleet that are asked what they know of all.
const SPEAKERS: usize = 12;

/// What is not right yet; `None` when all is.
pub fn lacking(fleet: &Fleet) -> Option<String> {
    let on: Vec<usize> =
        (0..fleet.robots.len()).filter(|robot| fleet.robots[*robot].is_on()).collect();
    one_coordinator(fleet, &on)
        .or_else(|| equal_tables(fleet, &on))
        .or_else(|| each_once(fleet, &on))
        .or_else(|| latest_edition(fleet, &on))
        .or_else(|| standbys_ready(fleet, &on))
        .or_else(|| known_to_all(fleet, &on))
        .or_else(|| all_heard(fleet))
}

/// All know one coordinator, which knows it too.
pub fn one_coordinator(fleet: &Fleet, on: &[usize]) -> Option<String> {
    let first = fleet.robots[*on.first()?].coordinator();
    let Some((holder, term)) = first else { return Some("nobody coordinates".into()) };
    for robot in on {
        let robot = &fleet.robots[*robot];
        match robot.coordinator() {
            Some(known) if known == (holder, term) => {}
            Some((other, _)) => return Some(format!("{} follows {other}, not {holder}", robot.id)),
            None => return Some(format!("{} knows no coordinator", robot.id)),
        }
    }
    let holds = on.iter().any(|robot| fleet.robots[*robot].id == *holder);
    (!holds).then(|| format!("{holder} coordinates and is off"))
}

fn equal_tables(fleet: &Fleet, on: &[usize]) -> Option<String> {
    let length = |robot: &usize| fleet.table(*robot).map(FleetTable::len);
    let first = length(on.first()?);
    if let Some(other) = on.iter().find(|robot| length(robot) != first) {
        return extra(fleet, on[0], *other).or_else(|| extra(fleet, *other, on[0]));
    }
    // the tables' own hashes first: only when they agree is it worth not to believe them
    let root = |robot: &usize| fleet.table(*robot).map(FleetTable::root);
    let of_first = root(on.first()?);
    if let Some(other) = on.iter().find(|robot| root(robot) != of_first) {
        return Some(format!("tables of robot-{} and robot-{} differ", on[0] + 1, other + 1));
    }
    let compared = on.len().min((RECORDS_MAX / first?.max(1)).max(2));
    let first = fleet.table(*on.first()?)?;
    let same = |robot: &usize| fleet.table(*robot).is_some_and(|table| same_table(table, first));
    let other = on[..compared].iter().find(|robot| !same(robot))?;
    Some(format!("tables of robot-{} and robot-{} differ", on[0] + 1, other + 1))
}

/// A record that one robot holds and the other does not.
fn extra(fleet: &Fleet, holder: usize, other: usize) -> Option<String> {
    let (table, other_table) = (fleet.table(holder)?, fleet.table(other)?);
    let mut keys = (0..=u8::MAX).flat_map(|kind| table.of_kind(RecordKind(kind)));
    let (key, version, _) = keys.find(|(key, ..)| other_table.record(key).is_none())?;
    Some(format!(
        "robot-{} holds {} (kind {}, revision {}), robot-{} does not",
        holder + 1,
        key.name,
        key.kind.0,
        version.revision,
        other + 1
    ))
}

fn each_once(fleet: &Fleet, on: &[usize]) -> Option<String> {
    let wanted = fleet.wanted(on);
    let table = fleet.table(*on.first()?)?;
    for key in &wanted {
        let active = fleet.active(key);
        let [only] = active else {
            return Some(format!("{key} is active {} times", active.len()));
        };
        let home = match table.get(RecordKind::ASSIGNMENT, &key.to_string()) {
            Some((_, FleetValue::Assignment(assignment))) => Some(&assignment.home),
            Some(_) | None => None,
        };
        let place = &fleet.robots[only.robot].id;
        if home != Some(place) {
            return Some(format!("{key} is active on {place}, not at its home {home:?}"));
        }
    }
    let wanted: BTreeSet<&ComponentKey> = wanted.iter().collect();
    let extra = (0..fleet.components()).find(|component| {
        !fleet.active_of(*component).is_empty() && !wanted.contains(fleet.key(*component))
    })?;
    Some(format!("{} is active and nobody wants it", fleet.key(extra)))
}

/// Every process runs what its component is wanted to be now.
fn latest_edition(fleet: &Fleet, on: &[usize]) -> Option<String> {
    let table = fleet.table(*on.first()?)?;
    for robot in on {
        for (_, process) in fleet.robots[*robot].processes() {
            let key = &process.component;
            let Some((_, FleetValue::Component(spec))) =
                table.get(RecordKind::COMPONENT, &format!("{}/{}", key.system, key.name))
            else {
                continue;
            };
            if spec.needs != process.needs {
                return Some(format!("{key} runs an old edition on robot-{}", robot + 1));
            }
        }
    }
    None
}

/// Who is listed for a hot standby has it, ready and inactive, and nobody else has one.
fn standbys_ready(fleet: &Fleet, on: &[usize]) -> Option<String> {
    let table = fleet.table(*on.first()?)?;
    for key in fleet.wanted(on) {
        let found = table.get(RecordKind::ASSIGNMENT, &key.to_string());
        let Some((_, FleetValue::Assignment(assignment))) = found else { continue };
        let (hot, count) = fleet.standbys(&key, on)?;
        if assignment.standbys.len() > count {
            return Some(format!("{key} has {} standbys, not {count}", assignment.standbys.len()));
        }
        for robot in on {
            let id = &fleet.robots[*robot].id;
            let target = assignment.target.as_ref() == Some(id);
            let stands_by = target || (hot && assignment.standbys.contains(id));
            let wanted = usize::from(stands_by) + usize::from(assignment.home == *id);
            let processes = fleet.robots[*robot].processes().filter(|(_, of)| of.component == key);
            let states: Vec<LifecycleState> = processes.map(|(_, of)| of.state).collect();
            let sound = |state: &LifecycleState| {
                matches!(state, LifecycleState::Active | LifecycleState::Inactive)
            };
            if states.len() != wanted || !states.iter().all(sound) {
                return Some(format!("{id} has {states:?} of {key}, not {wanted} processes"));
            }
        }
    }
    None
}

/// What each robot says of its processes is what the others hold of it.
fn known_to_all(fleet: &Fleet, on: &[usize]) -> Option<String> {
    for author in on {
        let id = &fleet.robots[*author].id;
        let own = instances_of(fleet, *author, id);
        for other in on.iter().take(SPEAKERS) {
            if instances_of(fleet, *other, id) != own {
                return Some(format!("robot-{} has old news of {id}", other + 1));
            }
        }
    }
    None
}

/// State and token of each process of `author`, as `robot` holds it.
fn instances_of(
    fleet: &Fleet,
    robot: usize,
    author: &RobotId,
) -> Vec<(ComponentKey, LifecycleState, Option<Token>)> {
    let mesh = fleet.robots[robot].brain().map(Brain::mesh);
    let author = mesh.and_then(|mesh| mesh.authors().author(author));
    let instances = author.into_iter().flat_map(|author| author.instances());
    instances.map(|of| (of.component.clone(), of.state, of.token.clone())).collect()
}

fn all_heard(fleet: &Fleet) -> Option<String> {
    for robot in &fleet.robots {
        for (_, process) in robot.processes() {
            if process.token.is_none() {
                continue;
            }
            if let Some(deaf) = fleet.unheard(process) {
                return Some(format!("{} does not hear {deaf}", process.component));
            }
        }
    }
    None
}
