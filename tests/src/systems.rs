//! Systems for the harness.

use sdr_core::{
    id::Name,
    spec::{ComponentSpec, ConnectionSpec, Needs, PolicyBytes, PortRef, Qos, SystemSpec},
    units::{Bytes, Permille},
};

/// A name; panics on a bad one.
pub fn name(word: &str) -> Name {
    Name::new(word).expect("names in tests are names")
}

/// A component that needs `memory_mega` MB and a tenth of a core.
pub fn component(word: &str, memory_mega: u64) -> ComponentSpec {
    let needs = Needs { memory: Bytes::mega(memory_mega), cpu: Permille(100) };
    sdr_lab::sim::systems::component(name(word), word, needs)
}

/// `from.port -> to.port`.
pub fn connection(from: (&str, &str), to: (&str, &str)) -> ConnectionSpec {
    let port =
        |(component, port): (&str, &str)| PortRef { component: name(component), port: name(port) };
    ConnectionSpec {
        index: 0,
        from: port(from),
        to: port(to),
        message_type: "std_msgs/msg/Bool".into(),
        qos: Qos::default(),
    }
}

/// The paper's Fig. 3 with the policies of Tables V and VI.
pub fn exploration() -> SystemSpec {
    let memory = 530;
    SystemSpec {
        name: name("exploration"),
        components: ["fisheye", "anomaly", "camera", "controller", "position"]
            .map(|word| component(word, memory))
            .into(),
        connections: vec![
            connection(("fisheye", "image"), ("anomaly", "image")),
            connection(("anomaly", "danger"), ("controller", "danger")),
            connection(("camera", "image"), ("position", "image")),
            connection(("position", "odometry"), ("controller", "odometry")),
            connection(("controller", "wheels"), ("position", "wheels")),
        ],
        allocation: allocation("exploration"),
        recovery: recovery("exploration"),
    }
}

/// A component alone, under the default policies.
pub fn single(memory_mega: u64) -> SystemSpec {
    SystemSpec {
        name: name("alone"),
        components: vec![component("worker", memory_mega)],
        connections: Vec::new(),
        allocation: PolicyBytes::default(),
        recovery: PolicyBytes::default(),
    }
}

/// The allocation policy of a file in `policies/allocation`.
pub fn allocation(word: &str) -> PolicyBytes {
    let path = policies().join("allocation").join(format!("{word}.yaml"));
    let policy = sdr_files::load_allocation(&path).unwrap_or_else(|error| panic!("{error}"));
    policy.encode()
}

/// The recovery policy of a file in `policies/recovery`.
pub fn recovery(word: &str) -> PolicyBytes {
    let path = policies().join("recovery").join(format!("{word}.yaml"));
    let policy = sdr_files::load_recovery(&path).unwrap_or_else(|error| panic!("{error}"));
    policy.encode()
}

fn policies() -> std::path::PathBuf {
    std::path::Path::new(env!("CARGO_MANIFEST_DIR")).join("../policies")
}
