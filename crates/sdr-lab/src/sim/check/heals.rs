//! A heal restarts nothing that was right.

use std::{
    collections::{BTreeMap, BTreeSet},
    time::Duration,
};

use sdr_core::{id::Name, record::RecordKind, time::Instant};

use crate::sim::{ActiveProcess, Broken, Checker, Fleet, Sight};

/// So long after a heal, with nothing else going wrong, the same processes must be active.
const SETTLED: Duration = Duration::from_secs(12);
/// Until then after a heal, a robot may decide by what it knew before it: its first datagrams
/// from the other side are still to come.
const HEARS_WITHIN: Duration = Duration::from_secs(1);

/// What brains say when a component is in trouble of its own. A lease that ends in bad weather
/// is one: the process stays and waits for a sign.
const TROUBLE: [&str; 7] = [
    "exited",
    "hung",
    "error",
    "condition-raised",
    "move-started",
    "restart",
    "isolated-deactivated",
];
/// What they say of a home that is silent, and of its next one.
const CHOICES: [&str; 2] = ["placed", "promoted"];

/// `restarted-by-heal`.
#[derive(Debug, Default)]
pub struct Heals {
    healed_at: Option<Instant>,
    before: BTreeMap<usize, Vec<ActiveProcess>>,
    /// What an operator asked on one side of a cut: the other hears of it by the heal.
    asked: BTreeSet<Name>,
}

impl Checker for Heals {
    fn watch(&mut self, fleet: &Fleet, sight: &Sight) -> Option<Broken> {
        if matches!(sight, Sight::Healed) && !fleet.is_cut() {
            self.healed_at = Some(fleet.now);
            self.before = (0..fleet.components())
                .map(|component| (component, fleet.active_of(component).to_vec()))
                .filter(|(component, active)| is_right(fleet, *component, active))
                .filter(|(component, _)| !self.asked.contains(&fleet.key(*component).system))
                .collect();
            self.asked.clear();
        }
        // an operator wants something else, or a component is in trouble of its own
        if let Sight::Asked { system, .. } = sight {
            self.asked.extend(fleet.is_cut().then(|| system.clone()));
            self.excuse(fleet, system, None);
        }
        if let Sight::Told { event, .. } = sight
            && let (Some(system), true) = (&event.system, self.excuses(fleet, &event.kind))
        {
            self.excuse(fleet, system, event.component.as_ref());
        }
        if matches!(sight, Sight::Off { .. } | Sight::On { .. }) {
            self.healed_at = None;
        }
        matches!(sight, Sight::Look).then(|| self.look(fleet)).flatten()
    }
}

/// Whether one of these processes is the one that stays: it works under the greatest choice of
/// a home that any robot knows. When the home of that one was just lost, the others have to
/// stop all the same, and a new one is found as for any home that is gone.
fn is_right(fleet: &Fleet, component: usize, active: &[ActiveProcess]) -> bool {
    let name = fleet.key(component).to_string();
    let tables = (0..fleet.robots.len()).filter_map(|robot| fleet.table(robot));
    let homes = tables.filter_map(|table| table.get(RecordKind::ASSIGNMENT, &name));
    let greatest = homes.filter_map(|(version, _)| version.epoch.as_ref()).max();
    active.iter().any(|active| greatest.is_none_or(|epoch| active.token.epoch >= *epoch))
}

impl Heals {
    /// Whether a component of which a brain says this now need not go on where it ran.
    fn excuses(&self, fleet: &Fleet, kind: &str) -> bool {
        let just_healed = self.healed_at.is_some_and(|at| fleet.now < at + HEARS_WITHIN);
        TROUBLE.contains(&kind) || (just_healed && CHOICES.contains(&kind))
    }

    fn excuse(&mut self, fleet: &Fleet, system: &Name, component: Option<&Name>) {
        self.before.retain(|number, _| {
            let key = fleet.key(*number);
            key.system != *system || component.is_some_and(|name| key.name != *name)
        });
    }

    fn look(&mut self, fleet: &Fleet) -> Option<Broken> {
        let healed_at = self.healed_at?;
        if fleet.steady_since() > healed_at + Duration::from_millis(1) {
            self.healed_at = None;
            return None;
        }
        if fleet.now < healed_at + SETTLED {
            return None;
        }
        self.healed_at = None;
        self.before.iter().find_map(|(component, before)| {
            let stays = fleet.active_of(*component).iter().any(|now| {
                before.iter().any(|then| (then.robot, then.instance) == (now.robot, now.instance))
            });
            (!stays).then(|| {
                let places: Vec<String> =
                    before.iter().map(|then| format!("robot-{}", then.robot + 1)).collect();
                let now: Vec<String> = fleet
                    .active_of(*component)
                    .iter()
                    .map(|now| format!("robot-{}", now.robot + 1))
                    .collect();
                let what = format!(
                    "{} was active on {}, now on [{}]",
                    fleet.key(*component),
                    places.join(" and "),
                    now.join(", ")
                );
                Broken::new("restarted-by-heal", what)
            })
        })
    }
}
