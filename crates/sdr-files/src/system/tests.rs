//! What a system means.

use sdr_core::{
    id::Name,
    recover::Cause,
    spec::{ComponentProfile, DeviceProfile, ParameterProfile, PortProfile, Value},
};

use super::*;

fn parse(text: &str) -> Result<LoadedSystem, Problems> {
    parse_system("s.yaml", text, Path::new("/nowhere"))
}

#[test]
fn the_exploration_system_is_the_papers() {
    let text = include_str!("../../../../systems/exploration.yaml");

    let spec = parse(text).unwrap().spec;

    let names: Vec<&str> = spec.components.iter().map(|c| c.name.as_str()).collect();
    assert_eq!(names, ["fisheye", "anomaly", "camera", "controller", "position"]);
    assert_eq!(spec.connections.len(), 5);
    let allocation = sdr_alloc::Policy::decode(&spec.allocation).unwrap();
    assert_eq!(allocation.strict.memory_free_at_least.unwrap().0, 500_000_000);
    let recovery = sdr_recovery::Policy::decode(&spec.recovery).unwrap();
    assert!(recovery.parts().rules.iter().any(|rule| rule.cause == Cause::RssiLow));
}

fn profile(name: &str, input: &str, output: &str) -> ComponentProfile {
    let port = |name: &str| PortProfile {
        name: Name::new(name).unwrap(),
        message_type: String::from("std_msgs/msg/Bool"),
        size_hint_bytes: 0,
    };
    ComponentProfile {
        name: name.to_owned(),
        about: String::new(),
        inputs: vec![port(input)],
        outputs: vec![port(output)],
        parameters: vec![ParameterProfile {
            name: String::from("speed"),
            about: String::new(),
            default: Value::Float(0.5),
            min: Some(Value::Float(0.0)),
            max: Some(Value::Float(2.0)),
        }],
        devices: vec![
            DeviceProfile { name: String::from("wheels"), unless: None },
            DeviceProfile { name: String::from("eye"), unless: Some(String::from("speed")) },
        ],
    }
}

#[test]
fn linking_fills_message_types_and_makes_whole_numbers_numbers() {
    let text = "system: s\ncomponents:\n  a: { run: { native: x }, devices: [wheels], parameters: { speed: 1 } }\n  \
                b: { run: { native: x }, devices: [wheels, eye] }\nconnections: [a.out -> b.in, b.out -> a.in]\n";
    let mut system = parse(text).unwrap();

    link_profiles(&mut system, &[profile("x", "in", "out")]).unwrap();

    assert_eq!(system.spec.connections[1].message_type, "std_msgs/msg/Bool");
    assert_eq!(system.spec.components[0].parameters[0].1, Value::Float(1.0));
}

#[test]
fn linking_tells_what_is_not_there() {
    let text = "system: s\ncomponents:\n  a: { run: { native: x }, parameters: { sped: 1 } }\n  \
                b: { run: { native: y } }\nconnections: [a.in -> a.in, a.ouy -> a.in]\n";
    let mut system = parse(text).unwrap();

    let problems = link_profiles(&mut system, &[profile("x", "in", "out")]).unwrap_err();

    let text = problems.to_string();
    for part in [
        "unknown parameter of x `sped`; allowed: speed (did you mean `speed`?)",
        "unknown executable `y`",
        "a.in is an input of x, not an output; allowed: out",
        "unknown output of x `ouy`; allowed: out (did you mean `out`?)",
    ] {
        assert!(text.contains(part), "{part}\n{text}");
    }
}

#[test]
fn ranges_and_devices_are_told_before_anything_starts() {
    let text = "system: s\ncomponents:\n  a:\n    run: { native: x }\n    parameters: { speed: 3 }\n  \
                b: { run: { native: x }, devices: [wheels] }\n";
    let mut system = parse(text).unwrap();

    let problems = link_profiles(&mut system, &[profile("x", "in", "out")]).unwrap_err();

    let told: Vec<String> = problems
        .as_slice()
        .iter()
        .map(|problem| {
            let help = problem.help.as_deref().unwrap_or_default();
            format!("{}:{} {}; {help}", problem.line, problem.column, problem.message)
        })
        .collect();
    assert_eq!(
        told,
        [
            "4:20 x needs the device `wheels`; add `devices: [wheels]`",
            "5:26 parameter `speed` is 3; allowed: 0 to 2",
            "6:23 x needs the device `eye`; add `devices: [eye]`, or its parameter `speed`",
        ]
    );
}

#[test]
fn everything_wrong_with_a_system_is_told_at_once() {
    let text = "system: s\ncomponents:\n  a: { run: { native: x }, rat: 5Hz, after: [b] }\n  \
                b: { run: { native: x }, rate: 5, after: [a, c] }\nconnections: [a.out -> d.in]\n";

    let text = parse(text).unwrap_err().to_string();

    for part in [
        "s.yaml:3:28: unknown key `rat`",
        "(did you mean `rate`?)",
        "s.yaml:4:34: `5` has no unit",
        "goes round in a circle: a after b after a",
        "unknown component `c`",
        "unknown component `d`",
    ] {
        assert!(text.contains(part), "{part}\n{text}");
    }
}
