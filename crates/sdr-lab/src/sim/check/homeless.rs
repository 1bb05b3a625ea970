//! No component is without an active process for longer than detection and 3 s, while the
//! robots that could run it are together and nothing else goes wrong.

use std::{collections::BTreeMap, time::Duration};

use sdr_core::{
    fitness::Alone,
    id::ComponentKey,
    record::{FleetValue, RecordKind},
    time::Instant,
};

use crate::sim::{Broken, Checker, Fleet, Sight};

/// A robot that vanished is found by then (p99 of the bar).
const DETECTION: Duration = Duration::from_secs(12);
/// From then on, until its components run elsewhere.
const REHOMED: Duration = Duration::from_secs(3);
/// A home with a lease is given up so long after its end.
const LEASE_OVER: Duration = Duration::from_secs(1);
/// A component whose ladder was climbed is left alone by its robots for so long
/// (`not_back_for`, with what it takes to notice).
const TROUBLED: Duration = Duration::from_secs(135);
/// What brains say when a component is in trouble of its own.
const TROUBLE: [&str; 9] = [
    "exited",
    "hung",
    "error",
    "held",
    "restart",
    "condition-raised",
    "move-started",
    "move-failed",
    "respecified",
];

/// `homeless-too-long`.
#[derive(Debug, Default)]
pub struct Homeless {
    /// By the first robot of a side and the component.
    since: BTreeMap<(usize, ComponentKey), Instant>,
    troubled: BTreeMap<ComponentKey, Instant>,
}

impl Checker for Homeless {
    fn watch(&mut self, fleet: &Fleet, sight: &Sight) -> Option<Broken> {
        if let Sight::Told { event, .. } = sight
            && TROUBLE.contains(&event.kind.as_str())
            && let (Some(system), Some(name)) = (&event.system, &event.component)
        {
            self.troubled.insert(ComponentKey::new(system, name), fleet.now);
        }
        // a new revision begins its own count
        if let Sight::Asked { system, .. } = sight {
            self.since.retain(|(_, key), _| key.system != *system);
        }
        matches!(sight, Sight::Look).then(|| self.look(fleet)).flatten()
    }
}

impl Homeless {
    fn look(&mut self, fleet: &Fleet) -> Option<Broken> {
        let mut since = BTreeMap::new();
        let mut found = None;
        for side in fleet.sides() {
            // a robot alone decides nothing for others, and nothing at all that was told to wait
            let alone = side.len() < 2;
            if alone && (fleet.robots.len() > 2 || waits(fleet, &side)) {
                continue;
            }
            for key in fleet.wanted(&side) {
                let runs_here = |active: &crate::sim::ActiveProcess| side.contains(&active.robot);
                // who has a lease may not act alone, and its successor waits for its end
                let lease = fleet.lease(&key, &side);
                let must_not =
                    (alone && lease.is_some()) || !fleet.is_whole(key.system.as_str(), &side);
                let patience = lease.map_or(DETECTION, |lease| DETECTION.max(lease + LEASE_OVER));
                let runs = fleet.active(&key).iter().any(runs_here);
                if must_not || runs || !fleet.is_feasible(&key, &side) {
                    continue;
                }
                let name = (side[0], key.clone());
                let begun = self.since.get(&name).copied().unwrap_or(fleet.now);
                since.insert(name, begun);
                let clear = begun.max(fleet.steady_since());
                let late = fleet.now >= clear + patience + REHOMED
                    && fleet.is_steady_for(patience + REHOMED);
                let troubled = self.troubled.get(&key).is_some_and(|at| fleet.now < *at + TROUBLED);
                if late && !troubled {
                    let what = format!(
                        "{key} for {:.1} s, among {} robots",
                        fleet.now.since(begun).as_secs_f64(),
                        side.len()
                    );
                    found = found.or(Some(Broken::new("homeless-too-long", what)));
                }
            }
        }
        self.since = since;
        found
    }
}

/// Whether the fleet's role policy lets the last robot wait for the other.
fn waits(fleet: &Fleet, side: &[usize]) -> bool {
    let tables = side.iter().filter_map(|robot| fleet.table(*robot));
    tables.filter_map(|table| table.get(RecordKind::ROLE_POLICY, "")).any(
        |(_, value)| matches!(value, FleetValue::RolePolicy(policy) if policy.alone == Alone::Wait),
    )
}
