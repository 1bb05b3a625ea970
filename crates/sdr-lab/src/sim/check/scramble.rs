//! A role that nobody ever held is taken by the fittest, not by everybody who sees it free.

use std::{collections::BTreeSet, time::Duration};

use sdr_core::time::Instant;

use crate::sim::{Broken, Checker, Fleet, Sight};

/// So close together nobody heard of the others.
const TOGETHER: Duration = Duration::from_millis(300);
/// The fittest, and one who sees the others' links otherwise than they do.
const TAKERS_MAX: usize = 2;

/// `role-scramble`.
#[derive(Debug, Default)]
pub struct Scramble {
    /// Who took the role lately, under which term, and when.
    taken: Vec<(usize, u64, Instant)>,
}

impl Checker for Scramble {
    fn watch(&mut self, fleet: &Fleet, sight: &Sight) -> Option<Broken> {
        let Sight::Told { robot, event } = sight else { return None };
        // from a holder that is gone several may take it: each notices at its own time
        if event.kind != "role-taken" || !event.reason.contains("fittest of") {
            return None;
        }
        let (_, term) = fleet.robots[*robot].coordinator()?;
        self.taken.retain(|(.., at)| fleet.now.since(*at) <= TOGETHER);
        self.taken.push((*robot, term, fleet.now));
        let side = fleet.sides().into_iter().find(|side| side.contains(robot))?;
        let same = self.taken.iter().filter(|(other, of, _)| *of == term && side.contains(other));
        let takers: BTreeSet<&str> =
            same.map(|(other, ..)| fleet.robots[*other].id.as_str()).collect();
        (takers.len() > TAKERS_MAX).then(|| {
            let names: Vec<&str> = takers.into_iter().collect();
            Broken::new("role-scramble", format!("{} take term {term} together", names.join(", ")))
        })
    }
}
