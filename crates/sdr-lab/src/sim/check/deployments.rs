//! What any robot accepted is never lost while one robot lives that holds it.

use std::collections::{BTreeMap, BTreeSet};

use sdr_core::{
    api::DeployAnswer,
    mesh::FleetTable,
    record::{FleetValue, RecordKind},
};

use crate::sim::{Broken, Checker, Fleet, Sight};

/// `deployment-lost`.
#[derive(Debug, Default)]
pub struct Deployments {
    accepted: BTreeMap<String, Accepted>,
}

/// What was accepted of one system last.
#[derive(Debug, Default)]
struct Accepted {
    /// Two robots may accept one revision: the greater author's stays.
    version: (u64, String),
    /// Whether it should run; what should not may be forgotten by all.
    wanted: bool,
    /// Who has held it ever since.
    holders: BTreeSet<usize>,
}

impl Checker for Deployments {
    fn watch(&mut self, fleet: &Fleet, sight: &Sight) -> Option<Broken> {
        if let Sight::Answered { robot, answer: Ok(answer) } = sight {
            self.accept(fleet, *robot, answer);
        }
        if let Sight::On { robot, disk_kept } = sight {
            return self.restarted(fleet, *robot, *disk_kept);
        }
        matches!(sight, Sight::Look).then(|| self.look(fleet)).flatten()
    }
}

impl Deployments {
    fn accept(&mut self, fleet: &Fleet, robot: usize, answer: &DeployAnswer) {
        let author = fleet.robots[robot].id.to_string();
        let promised = ((answer.revision, author), true);
        let (version, wanted) = system_of(fleet, robot, &answer.system).unwrap_or(promised);
        let entry = self.accepted.entry(answer.system.clone()).or_default();
        if version > entry.version {
            *entry = Accepted { version, wanted, holders: BTreeSet::from([robot]) };
        }
    }

    fn restarted(&mut self, fleet: &Fleet, robot: usize, disk_kept: bool) -> Option<Broken> {
        let mut found = None;
        for (system, accepted) in &mut self.accepted {
            let holds = accepted.is_held(fleet, robot, system);
            if holds || !accepted.holders.remove(&robot) || !disk_kept {
                continue;
            }
            // what came over the air may be lost with power, what was answered for may not
            if accepted.holders.is_empty() {
                let what = format!(
                    "{system} revision {} is not on the disk of robot-{}",
                    accepted.version.0,
                    robot + 1
                );
                found = Some(Broken::new("deployment-lost", what));
            }
        }
        found
    }

    /// An undeployment that was stored before its robot could answer for it counts, too.
    fn take_undeployed(&mut self, fleet: &Fleet) {
        for (system, accepted) in &mut self.accepted {
            let robots = 0..fleet.robots.len();
            let known = robots.filter_map(|robot| system_of(fleet, robot, system));
            let greatest = known.filter(|(version, _)| *version > accepted.version).max();
            if let Some((version, false)) = greatest {
                *accepted = Accepted { version, wanted: false, holders: BTreeSet::new() };
            }
        }
    }

    fn look(&mut self, fleet: &Fleet) -> Option<Broken> {
        self.take_undeployed(fleet);
        let mut found = None;
        for (system, accepted) in &mut self.accepted {
            for robot in (0..fleet.robots.len()).filter(|robot| fleet.robots[*robot].is_on()) {
                if accepted.is_held(fleet, robot, system) {
                    // a part of it is nothing that others could begin with
                    if fleet.is_whole(system, &[robot]) {
                        accepted.holders.insert(robot);
                    }
                } else if accepted.holders.contains(&robot) {
                    let revision = accepted.version.0;
                    let what = format!("robot-{} forgot {system} revision {revision}", robot + 1);
                    found = Some(Broken::new("deployment-lost", what));
                }
            }
        }
        found
    }
}

impl Accepted {
    fn is_held(&self, fleet: &Fleet, robot: usize, system: &str) -> bool {
        let horizon = fleet.table(robot).and_then(FleetTable::horizon);
        let buried = horizon.is_some_and(|horizon| horizon.buries(system, self.version.0));
        let found = system_of(fleet, robot, system);
        found.is_some_and(|(version, _)| version >= self.version) || (buried && !self.wanted)
    }
}

/// Revision and author of a system as a robot holds it, and whether it should run.
fn system_of(fleet: &Fleet, robot: usize, system: &str) -> Option<((u64, String), bool)> {
    let (version, value) = fleet.table(robot)?.get(RecordKind::SYSTEM, system)?;
    let FleetValue::System(system) = value else { return None };
    Some(((version.revision, version.author.to_string()), system.wanted))
}
