//! Small builders: robots with plenty of everything, items that want little.

#![expect(dead_code, reason = "each test file uses its own part of the builders")]

use std::time::Duration;

use sdr_alloc::{Bars, IfUnknown, Policy, Strategy, Unknown, allocate};
use sdr_core::{
    allocate::{Homeless, Item, Pair, Plan, Problem, RobotOffer, Settled, Tier, Wire},
    id::{ComponentKey, Name, RobotId},
    spec::{Needs, Place},
    units::{Bytes, Dbm, Permille, Position},
};

pub(crate) fn name(word: &str) -> Name {
    Name::new(word).expect("a name")
}

pub(crate) fn robot_id(word: &str) -> RobotId {
    RobotId::new(word).expect("a robot")
}

/// 1900 MB and four cores free, at the origin, everything known.
pub(crate) fn offer(word: &str) -> RobotOffer {
    RobotOffer {
        robot: robot_id(word),
        memory_free: Bytes::mega(1900),
        cpu_capacity: Permille(4000),
        cpu_free: Permille(4000),
        battery: Some(Permille(900)),
        rssi: Some(Dbm::from_tenths(-470)),
        position: Some(Position::default()),
        labels: vec![],
        devices: vec![],
        launchables: vec![1],
    }
}

/// Wants 530 MB and 20 % of a core.
pub(crate) fn item(word: &str) -> Item {
    Item {
        component: ComponentKey::new(&name("exploration"), &name(word)),
        needs: Needs { memory: Bytes::mega(530), cpu: Permille(200) },
        launch: 1,
        devices: vec![],
        place: Place::default(),
        running_on: vec![],
        avoid: vec![],
    }
}

pub(crate) fn wire(from: &str, to: &str) -> Wire {
    Wire { from: name(from), to: name(to) }
}

pub(crate) fn settled(word: &str, home: &str) -> Settled {
    Settled { name: name(word), home: robot_id(home) }
}

/// A pair with 2 ms jitter, 5 ms delay, no loss.
pub(crate) fn pair(a: &str, b: &str) -> Pair {
    Pair {
        a: robot_id(a),
        b: robot_id(b),
        jitter: Some(Duration::from_millis(2)),
        delay: Some(Duration::from_millis(5)),
        loss: Some(Permille(0)),
    }
}

pub(crate) fn problem(policy: &Policy, robots: Vec<RobotOffer>, items: Vec<Item>) -> Problem {
    Problem {
        tier: Tier::Strict,
        policy: policy.encode(),
        receiver: robot_id("robot-1"),
        robots,
        items,
        settled: vec![],
        connections: vec![],
        pairs: vec![],
    }
}

/// First-fit with these bars, unknown facts refused.
pub(crate) fn first_fit(strict: Bars) -> Policy {
    Policy { strategy: Strategy::FirstFit, strict, relaxed: None, ..refusing() }
}

/// The default policy, but unknown facts are refused.
pub(crate) fn refusing() -> Policy {
    Policy {
        unknown: Unknown {
            battery: IfUnknown::Refuse,
            rssi: IfUnknown::Refuse,
            distance: IfUnknown::Refuse,
            ..Unknown::default()
        },
        ..Policy::default()
    }
}

/// The paper's Table V, as `policies/allocation/exploration.yaml` has it.
pub(crate) fn exploration() -> Policy {
    let memory = |mega| Bars { memory_free_at_least: Some(Bytes::mega(mega)), ..Bars::none() };
    Policy { name: "exploration".into(), relaxed: Some(memory(250)), ..first_fit(memory(500)) }
}

/// `component: robot` in the order of the plan.
pub(crate) fn homes(plan: &Plan) -> Vec<String> {
    let homes = plan.placements.iter();
    homes.map(|placement| format!("{}: {}", placement.component.name, placement.robot)).collect()
}

pub(crate) fn solve(problem: &Problem) -> Plan {
    allocate(problem).expect("a policy")
}

/// The reasons of a component without a home, as people read them.
pub(crate) fn reasons(homeless: &Homeless) -> Vec<String> {
    homeless.refusals.iter().map(ToString::to_string).collect()
}
