//! What a robot knows to be undeployed does not come back there.

use std::collections::BTreeMap;

use sdr_core::{
    order::Version,
    record::{FleetValue, RecordKind},
};

use crate::sim::{Broken, Checker, Fleet, Sight};

/// `resurrected`.
#[derive(Debug, Default)]
pub struct Tombs {
    /// By robot, the start of its agent, and the system: the version that undeployed it.
    dead: BTreeMap<(usize, u64, String), Version>,
}

impl Checker for Tombs {
    fn watch(&mut self, fleet: &Fleet, sight: &Sight) -> Option<Broken> {
        if !matches!(sight, Sight::Look) {
            return None;
        }
        (0..fleet.robots.len()).find_map(|robot| self.look(fleet, robot))
    }
}

impl Tombs {
    fn look(&mut self, fleet: &Fleet, robot: usize) -> Option<Broken> {
        let life = fleet.robots[robot].life();
        for (key, version, value) in fleet.table(robot)?.of_kind(RecordKind::SYSTEM) {
            let FleetValue::System(system) = value else { continue };
            let name = (robot, life, key.name.clone());
            let dead = self.dead.get(&name);
            if !system.wanted {
                if dead.is_none_or(|dead| dead < version) {
                    self.dead.insert(name, version.clone());
                }
            } else if let Some(dead) = dead.filter(|dead| version <= *dead) {
                let what = format!(
                    "robot-{} wants {} {version:?}, which {dead:?} undeployed there",
                    robot + 1,
                    key.name
                );
                return Some(Broken::new("resurrected", what));
            }
        }
        None
    }
}
