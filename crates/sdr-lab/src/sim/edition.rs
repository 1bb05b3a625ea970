//! Drawn editions of small systems, and drawn policies.

use std::time::Duration;

use sdr_core::{
    fitness::{Alone, RoleBars, RolePolicy, RoleWeights},
    id::{Name, RobotId},
    spec::{
        Isolation, IsolationAction, Needs, PolicyBytes, Standby, StandbyKind, StandbyWhere,
        SystemSpec,
    },
    units::{Bytes, Permille},
};

use super::{Chance, systems};

/// Leases that are drawn: shorter and longer than a robot's silence may be.
const LEASES_S: [u64; 4] = [1, 2, 4, 15];

/// A system in one of its editions: other needs, other length, other policies, leases.
pub(crate) fn system(chance: &mut Chance, number: usize) -> SystemSpec {
    let edition = chance.below(6);
    let mut system = plain(number, edition);
    if edition >= 3 {
        system.recovery = systems::patient();
    }
    match chance.below(12) {
        0..=1 => lease(chance, &mut system),
        2 => system.allocation = first_fit(),
        3 => system.recovery = unreadable(chance),
        4 => system.allocation = unreadable(chance),
        _ => {}
    }
    system
}

fn plain(number: usize, edition: usize) -> SystemSpec {
    let memory = if edition.is_multiple_of(2) { 40 } else { 60 };
    let needs = Needs { memory: Bytes::mega(memory), cpu: Permille(50) };
    let components = 2 + edition % 3;
    let mut system = systems::chain(systems::name("system", number), components, needs);
    for (index, component) in system.components.iter_mut().enumerate() {
        let name = systems::component_name(number, index);
        component.name = Name::new(&name).expect("short words make names");
    }
    for (index, wire) in system.connections.iter_mut().enumerate() {
        wire.from.component = system.components[index].name.clone();
        wire.to.component = system.components[index + 1].name.clone();
    }
    system
}

/// Some of its components must not act while nobody hears their robot.
fn lease(chance: &mut Chance, system: &mut SystemSpec) {
    let after = Duration::from_secs(LEASES_S[chance.below(LEASES_S.len())]);
    let first = chance.below(system.components.len());
    for component in &mut system.components[first..] {
        component.on_isolation = Isolation { action: IsolationAction::Deactivate, after };
    }
}

/// Some of its components wish for standbys: hot or cold, on their own robot or elsewhere.
pub(crate) fn back_up(chance: &mut Chance, system: &mut SystemSpec) {
    for component in &mut system.components {
        if chance.happens(0.4) {
            continue;
        }
        let place = match chance.below(4) {
            0 => StandbyWhere::SameRobot,
            1 => StandbyWhere::Any,
            _ => StandbyWhere::OtherRobot,
        };
        let kind = match chance.happens(0.7) {
            true => StandbyKind::Hot,
            false => StandbyKind::Cold,
        };
        let count = 1 + u8::from(chance.happens(0.3));
        component.standby = Standby { count, place, kind, ..Standby::default() };
    }
}

fn first_fit() -> PolicyBytes {
    let strategy = sdr_alloc::Strategy::FirstFit;
    let name = String::from("first-fit");
    sdr_alloc::Policy { name, strategy, ..sdr_alloc::Policy::default() }.encode()
}

/// Bytes that no version of this project wrote, or a version that is still to come.
fn unreadable(chance: &mut Chance) -> PolicyBytes {
    let bytes = (0..chance.between(1, 40)).map(|_| chance.bits().to_le_bytes()[0] | 0x80);
    PolicyBytes { name: String::from("unreadable"), bytes: bytes.collect() }
}

/// Another way to choose the holder of the role.
pub(crate) fn role_policy(chance: &mut Chance, robots: usize) -> RolePolicy {
    let usual = RolePolicy::default();
    let robot = |number: usize| {
        RobotId::new(&format!("robot-{}", number + 1)).expect("a number makes a name")
    };
    let (name, policy) = match chance.below(6) {
        0 => ("default", usual),
        1 => ("wait", RolePolicy { alone: Alone::Wait, ..usual }),
        2 => ("pinned", RolePolicy { pinned: vec![robot(chance.below(robots))], ..usual }),
        3 => ("forbidden", RolePolicy { forbidden: vec![robot(chance.below(robots))], ..usual }),
        4 => {
            let weights = RoleWeights { battery: 0, cpu: 0, memory: 0, links: 0, centrality: 0 };
            ("alike", RolePolicy { weights, bars: RoleBars::default(), ..usual })
        }
        _ => {
            let beat = chance.time(Duration::from_millis(100), Duration::from_millis(500));
            let misses = u32::try_from(chance.between(3, 8)).unwrap_or(4);
            ("hasty", RolePolicy { beat, misses, margin_for: Duration::from_secs(3), ..usual })
        }
    };
    RolePolicy { name: name.into(), ..policy }
}
