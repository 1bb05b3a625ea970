//! What a system must not say.

use alloc::{string::String, vec, vec::Vec};
use core::time::Duration;

use super::*;

fn name(word: &str) -> Name {
    Name::new(word).unwrap()
}

pub(crate) fn component(word: &str, after: &[&str]) -> ComponentSpec {
    ComponentSpec {
        name: name(word),
        index: 0,
        launch: Launch::Native { executable: String::from(word), arguments: Vec::new() },
        needs: Needs::default(),
        execution: Execution::OnData,
        devices: Vec::new(),
        place: Place::default(),
        after: after.iter().map(|word| name(word)).collect(),
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

fn system(components: Vec<ComponentSpec>) -> SystemSpec {
    SystemSpec {
        name: name("s"),
        components,
        connections: Vec::new(),
        allocation: PolicyBytes::default(),
        recovery: PolicyBytes::default(),
    }
}

#[test]
fn a_circle_in_the_start_order_is_refused_and_named() {
    let fine = system(vec![component("a", &[]), component("b", &["a"]), component("c", &["b"])]);
    assert_eq!(fine.check(), Ok(()));

    let round =
        system(vec![component("a", &["c"]), component("b", &["a"]), component("c", &["b"])]);
    assert_eq!(round.check(), Err(SpecError::StartCycle(name("a"))));
}

#[test]
fn duplicates_and_unknown_names_are_refused() {
    let twice = system(vec![component("a", &[]), component("a", &[])]);
    assert_eq!(twice.check(), Err(SpecError::DuplicateComponent(name("a"))));

    let unknown = system(vec![component("a", &["ghost"])]);
    assert_eq!(unknown.check(), Err(SpecError::UnknownComponent(name("ghost"))));
    assert_eq!(system(vec![]).check(), Err(SpecError::Empty));
}

#[test]
fn loops_of_data_are_legal() {
    let port = |word: &str, port: &str| PortRef { component: name(word), port: name(port) };
    let connection = |from: PortRef, to: PortRef| ConnectionSpec {
        index: 0,
        from,
        to,
        message_type: String::from("std_msgs/msg/Bool"),
        qos: Qos::default(),
    };
    let mut looped = system(vec![component("a", &[]), component("b", &[])]);
    looped.connections = vec![
        connection(port("a", "out"), port("b", "in")),
        connection(port("b", "out"), port("a", "in")),
    ];
    assert_eq!(looped.check(), Ok(()));

    let again = looped.connections[0].clone();
    looped.connections.push(again);
    assert!(matches!(looped.check(), Err(SpecError::DuplicateConnection(_))));
}

#[test]
fn values_survive_the_mesh_with_their_kind() {
    let value = Value::List(vec![
        Value::Bool(true),
        Value::Int(-3),
        Value::Float(0.5),
        Value::Text(String::from("red_box")),
    ]);
    let bytes = postcard::to_allocvec(&value).unwrap();
    assert_eq!(postcard::from_bytes::<Value>(&bytes).unwrap(), value);
}
