//! At most one coordinator on each connected side, once things have settled.

use std::time::Duration;

use crate::sim::{Broken, Checker, Fleet, Sight};

/// How long after the last disturbance two are too many.
const SETTLE: Duration = Duration::from_secs(15);

/// `two-coordinators`.
#[derive(Debug, Default)]
pub struct Coordinators {}

impl Checker for Coordinators {
    fn watch(&mut self, fleet: &Fleet, sight: &Sight) -> Option<Broken> {
        if !matches!(sight, Sight::Look) || !fleet.is_steady_for(SETTLE) {
            return None;
        }
        fleet.sides().iter().find_map(|side| {
            let holders: Vec<&str> = side
                .iter()
                .map(|robot| &fleet.robots[*robot])
                .filter(|robot| robot.is_coordinator())
                .map(|robot| robot.id.as_str())
                .collect();
            (holders.len() > 1).then(|| Broken::new("two-coordinators", holders.join(" and ")))
        })
    }
}
