//! Systems for simulated fleets.

use std::time::Duration;

use sdr_core::{
    id::Name,
    recover::Cause,
    spec::{
        ComponentSpec, ConnectionSpec, Execution, Isolation, IsolationAction, Launch, Limits,
        Needs, Place, PolicyBytes, PortRef, Qos, Standby, SystemSpec,
    },
    units::{Bytes, Permille},
};

/// What every simulated robot can launch.
pub const WORD: &str = "worker";

/// A name made of a word and a number.
pub fn name(word: &str, number: usize) -> Name {
    Name::new(&format!("{word}{number}")).expect("short words and numbers make names")
}

/// A component without wishes: 15 Hz, anywhere, going on when it is alone.
pub fn component(name: Name, executable: &str, needs: Needs) -> ComponentSpec {
    ComponentSpec {
        name,
        index: 0,
        launch: Launch::Native { executable: executable.into(), arguments: Vec::new() },
        needs,
        execution: Execution::Periodic { period: Duration::from_millis(66) },
        devices: Vec::new(),
        place: Place::default(),
        after: Vec::new(),
        actuator: false,
        on_isolation: Isolation {
            action: IsolationAction::Continue,
            after: Duration::from_millis(500),
        },
        standby: Standby::default(),
        parameters: Vec::new(),
        on_agent_death: None,
        limits: Limits::default(),
    }
}

/// Components in a chain: each feeds the next through its port `out`.
pub fn chain(system: Name, components: usize, needs: Needs) -> SystemSpec {
    let component = |index: usize| component(name("c", index), WORD, needs);
    let port = |component: usize, port: &str| PortRef {
        component: name("c", component),
        port: Name::new(port).expect("a word is a name"),
    };
    let wire = |index: usize| ConnectionSpec {
        index: 0,
        from: port(index, "out"),
        to: port(index + 1, "into"),
        message_type: "std_msgs/msg/Bool".into(),
        qos: Qos::default(),
    };
    SystemSpec {
        name: system,
        components: (0..components).map(component).collect(),
        connections: (1..components).map(|index| wire(index - 1)).collect(),
        allocation: PolicyBytes::default(),
        recovery: PolicyBytes::default(),
    }
}

/// Needs so small that a third of the robots can hold all `components`.
pub fn fitting(robots: usize, components: usize, memory: Bytes, cpu: Permille) -> Needs {
    let robots = (robots / 3).max(1) as u64;
    let components = components.max(1) as u64;
    let memory = (memory.0 / 2 * robots / components).min(100_000_000);
    let cpu = u64::from(cpu.0) / 2 * robots / components;
    Needs { memory: Bytes(memory), cpu: Permille(u32::try_from(cpu.clamp(1, 100)).unwrap_or(1)) }
}

/// The default recovery without the rules about links: a measured loss that was asked for
/// is then no reason to move.
pub fn patient() -> PolicyBytes {
    let default = sdr_recovery::Policy::decode(&PolicyBytes::default());
    let mut parts = default.expect("the default policy is a policy").parts().clone();
    let of_links =
        |cause: Cause| matches!(cause, Cause::DelayHigh | Cause::JitterHigh | Cause::LossHigh);
    parts.rules.retain(|rule| !of_links(rule.cause));
    sdr_recovery::Policy::new(parts).expect("fewer rules are still a policy").encode()
}

/// The name of a component of a drawn system: one in the whole fleet.
pub(crate) fn component_name(system: usize, component: usize) -> String {
    format!("s{system}c{component}")
}
