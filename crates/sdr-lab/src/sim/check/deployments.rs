//! What any robot accepted is never lost while one robot lives that holds it.

use std::collections::{BTreeMap, BTreeSet};

use sdr_core::record::RecordKind;

use crate::sim::{Broken, Checker, Fleet, Sight};

/// `deployment-lost`.
#[derive(Debug, Default)]
pub struct Deployments {
    /// By system: the greatest revision accepted, and who has held it ever since.
    accepted: BTreeMap<String, (u64, BTreeSet<usize>)>,
}

impl Checker for Deployments {
    fn watch(&mut self, fleet: &Fleet, sight: &Sight) -> Option<Broken> {
        if let Sight::Answered { robot, answer: Ok(answer) } = sight {
            let entry = self.accepted.entry(answer.system.clone()).or_default();
            if answer.revision > entry.0 {
                *entry = (answer.revision, BTreeSet::from([*robot]));
            }
        }
        if let Sight::On { robot, disk_kept } = sight {
            return self.restarted(fleet, *robot, *disk_kept);
        }
        matches!(sight, Sight::Look).then(|| self.look(fleet)).flatten()
    }
}

impl Deployments {
    fn restarted(&mut self, fleet: &Fleet, robot: usize, disk_kept: bool) -> Option<Broken> {
        let mut found = None;
        for (system, (revision, holders)) in &mut self.accepted {
            let holds = revision_of(fleet, robot, system) >= *revision;
            if holds || !holders.remove(&robot) || !disk_kept {
                continue;
            }
            // what came over the air may be lost with power, what was answered for may not
            if holders.is_empty() {
                let what = format!(
                    "{system} revision {revision} is not on the disk of robot-{}",
                    robot + 1
                );
                found = Some(Broken::new("deployment-lost", what));
            }
        }
        found
    }

    fn look(&mut self, fleet: &Fleet) -> Option<Broken> {
        let mut found = None;
        for (system, (revision, holders)) in &mut self.accepted {
            for robot in (0..fleet.robots.len()).filter(|robot| fleet.robots[*robot].is_on()) {
                if revision_of(fleet, robot, system) >= *revision {
                    // a part of it is nothing that others could begin with
                    if fleet.is_whole(system, &[robot]) {
                        holders.insert(robot);
                    }
                } else if holders.contains(&robot) {
                    let what = format!("robot-{} forgot {system} revision {revision}", robot + 1);
                    found = Some(Broken::new("deployment-lost", what));
                }
            }
        }
        found
    }
}

fn revision_of(fleet: &Fleet, robot: usize, system: &str) -> u64 {
    let found = fleet.table(robot).and_then(|table| table.get(RecordKind::SYSTEM, system));
    found.map_or(0, |(version, _)| version.revision)
}
