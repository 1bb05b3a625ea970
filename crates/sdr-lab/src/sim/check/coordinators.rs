//! At most one coordinator on each connected side, once things have settled.

use std::{collections::BTreeSet, time::Duration};

use sdr_core::time::Instant;

use crate::sim::{Broken, Checker, Fleet, Sight};

/// How long after the last disturbance two are too many.
const SETTLE: Duration = Duration::from_secs(15);
/// The role is handed over by a record: until it has arrived, its old holder cannot know. It is
/// repeated, and tables are compared, well within this, also on a bad radio; who hears nobody
/// at all decides nothing.
const HANDED_OVER: Duration = Duration::from_secs(5);

/// `two-coordinators`.
#[derive(Debug, Default)]
pub struct Coordinators {
    /// Those that decide together on one side, and since when they do.
    rivals: Option<(BTreeSet<usize>, Instant)>,
}

impl Checker for Coordinators {
    fn watch(&mut self, fleet: &Fleet, sight: &Sight) -> Option<Broken> {
        if !matches!(sight, Sight::Look) {
            return None;
        }
        let Some(now) = rivals(fleet) else {
            self.rivals = None;
            return None;
        };
        // one who is still among them has not heard of the other for so long
        let since = match self.rivals.take() {
            Some((before, since)) if now.intersection(&before).count() > 1 => since,
            Some(_) | None => fleet.now,
        };
        let names: Vec<&str> = now.iter().map(|robot| fleet.robots[*robot].id.as_str()).collect();
        let what = names.join(" and ");
        self.rivals = Some((now, since));
        let late = fleet.is_steady_for(SETTLE) && fleet.now >= since + HANDED_OVER;
        late.then(|| Broken::new("two-coordinators", what))
    }
}

/// Two or more of one side that decide for it.
fn rivals(fleet: &Fleet) -> Option<BTreeSet<usize>> {
    let holds = |robot: &usize| fleet.robots[*robot].coordinates();
    let sides = fleet.sides().into_iter();
    let mut holders = sides.map(|side| side.into_iter().filter(holds).collect::<BTreeSet<_>>());
    holders.find(|holders| holders.len() > 1)
}
