//! Isolation is a lease: a home that nobody hears stops in time, and before its successor acts.

use std::{collections::BTreeMap, time::Duration};

use sdr_core::{
    id::ComponentKey,
    order::Token,
    record::{FleetValue, RecordKind},
    time::Instant,
};

use crate::sim::{Broken, Checker, Fleet, Sight};

/// A successor waits so much longer than the lease: until then the home must have stopped.
const MARGIN: Duration = Duration::from_secs(1);

/// What brains say when they choose a home, the coordinator and a standby that follows.
const CHOICES: [&str; 2] = ["placed", "promoted"];

/// Larger fleets are not watched pair by pair.
const ROBOTS_MAX: usize = 50;

/// `acts-alone`, `both-act`.
///
/// A home with company on its side of a cut goes on, and the other side may choose another:
/// that both act then is no broken rule. Nor is what an agent that stands still leaves running.
#[derive(Debug, Default)]
pub struct Leases {
    /// Since when two robots, the lesser one first, have been apart at every look.
    apart: BTreeMap<(usize, usize), Instant>,
    /// When a robot said last that it placed a component, or followed its home.
    placed: BTreeMap<(usize, ComponentKey), Instant>,
}

impl Checker for Leases {
    fn watch(&mut self, fleet: &Fleet, sight: &Sight) -> Option<Broken> {
        if let Sight::Active { robot, component, token, .. } = sight {
            return self.both_act(fleet, *robot, *component, token);
        }
        if let Sight::Told { robot, event } = sight
            && CHOICES.contains(&event.kind.as_str())
            && let (Some(system), Some(name)) = (&event.system, &event.component)
        {
            self.placed.insert((*robot, ComponentKey::new(system, name)), fleet.now);
        }
        if !matches!(sight, Sight::Look) || fleet.robots.len() > ROBOTS_MAX {
            return None;
        }
        self.look(fleet);
        (0..fleet.components()).find_map(|number| Self::acts_alone(fleet, number))
    }
}

impl Leases {
    fn look(&mut self, fleet: &Fleet) {
        let robots = fleet.robots.len();
        for (a, b) in (0..robots).flat_map(|a| (a + 1..robots).map(move |b| (a, b))) {
            match fleet.apart_since(a, b).or_else(|| fleet.apart_since(b, a)) {
                Some(since) => {
                    self.apart.entry((a, b)).or_insert(since);
                }
                None => {
                    self.apart.remove(&(a, b));
                }
            }
        }
    }

    fn apart_since(&self, a: usize, b: usize) -> Option<Instant> {
        self.apart.get(&(a.min(b), a.max(b))).copied()
    }

    fn acts_alone(fleet: &Fleet, component: usize) -> Option<Broken> {
        let key = fleet.key(component);
        fleet.active_of(component).iter().find_map(|active| {
            let after = lease(fleet, active.robot, key)?;
            let alone = fleet.now.since(alone_since(fleet, active.robot)?);
            (alone >= after + MARGIN).then(|| {
                let what = format!(
                    "{key} is active on robot-{}, alone for {:.1} s with a lease of {:.1} s",
                    active.robot + 1,
                    alone.as_secs_f64(),
                    after.as_secs_f64()
                );
                Broken::new("acts-alone", what)
            })
        })
    }

    /// A successor that was chosen while nobody could hear the home, before its lease was over.
    fn both_act(
        &self,
        fleet: &Fleet,
        robot: usize,
        component: usize,
        token: &Token,
    ) -> Option<Broken> {
        let key = fleet.key(component);
        lease(fleet, robot, key)?;
        let minter = fleet.robot_number(&token.epoch.minted_by)?;
        let chosen_at = self.placed.get(&(minter, key.clone())).copied()?;
        fleet.active_of(component).iter().find_map(|before| {
            let older = before.robot != robot && before.token.epoch < token.epoch;
            // whoever is cut off cannot know of a lease that was given since
            let after = lease(fleet, before.robot, key).filter(|_| older)?;
            let alone_since = alone_since(fleet, before.robot)?;
            // with company on its side of a cut it was right to go on until that was gone, too
            let at_once = before.robot == minter
                || alone_since.since(self.apart_since(before.robot, minter)?) < MARGIN;
            let early = chosen_at >= alone_since && chosen_at.since(alone_since) < after + MARGIN;
            (early && at_once && !is_handed_over(fleet, robot, before.robot, key)).then(|| {
                let what = format!(
                    "{key} acts on robot-{} under {token} and alone on robot-{} under {}",
                    robot + 1,
                    before.robot + 1,
                    before.token
                );
                Broken::new("both-act", what)
            })
        })
    }
}

/// How long a component may act unheard on a robot, as that robot knows it: of an edition that
/// is still arriving it obeys nothing yet.
fn lease(fleet: &Fleet, robot: usize, key: &ComponentKey) -> Option<Duration> {
    let lease = fleet.lease(key, &[robot])?;
    fleet.is_whole(key.system.as_str(), &[robot]).then_some(lease)
}

/// Since when nobody can hear a robot and be heard, unless its agent stood still meanwhile.
fn alone_since(fleet: &Fleet, robot: usize) -> Option<Instant> {
    let since = fleet.alone_since(robot)?;
    (!fleet.was_paused_since(robot, since)).then_some(since)
}

/// A planned move makes before it breaks: the old home goes on until it hears of it.
fn is_handed_over(fleet: &Fleet, robot: usize, from: usize, key: &ComponentKey) -> bool {
    let table = fleet.table(robot);
    match table.and_then(|table| table.get(RecordKind::ASSIGNMENT, &key.to_string())) {
        Some((_, FleetValue::Assignment(now))) => {
            now.drains.as_ref() == Some(&fleet.robots[from].id)
        }
        Some(_) | None => false,
    }
}
