//! Declarations against configurations.

use std::collections::BTreeMap;

use sdr_core::id::ComponentKey;

use super::*;
use crate::{
    component::ComponentError,
    message::std_msgs::{Bool, Int32},
    protocol::{ExecutionSetup, PROTOCOL_VERSION},
    testing::Place,
};

struct Judge {
    score_min: f64,
    area: Vec<Vec<f64>>,
}

impl Component for Judge {
    const NAME: &'static str = "judge";
    const ABOUT: &'static str = "Judges.";

    fn new(setup: &mut Setup) -> Result<Self, ComponentError> {
        setup.input::<Int32>("score")?;
        setup.output::<Bool>("danger")?;
        let score_min = setup.parameter_within("score_min", 0.8, 0.0..=1.0, "share")?;
        let area = setup.parameter("area", vec![vec![0.0, 1.0]], "corners, m")?;
        setup.device("camera")?;
        Ok(Self { score_min, area })
    }
}

fn try_new(change: impl FnOnce(&mut Configure)) -> Result<Judge, String> {
    let place = Place::new();
    let mut configure = Configure {
        v: PROTOCOL_VERSION,
        component: ComponentKey::new(&Name::new("s").unwrap(), &Name::new("judge").unwrap()),
        parameters: BTreeMap::new(),
        devices: BTreeMap::from([(String::from("camera"), String::from("/c.sock"))]),
        inputs: Vec::new(),
        output_depth: 8,
        memory: place.memory.clone(),
        execution: ExecutionSetup::OnData,
    };
    change(&mut configure);
    let memory = Arc::new(Memory::open(&place.memory, "test").unwrap());
    let wiring = Wiring { configure: Arc::new(configure), memory };
    let mut setup = Setup::new::<Judge>(Some(wiring));
    let judge = Judge::new(&mut setup).map_err(|error| error.to_string())?;
    setup.check_complete().map_err(|error| error.to_string())?;
    Ok(judge)
}

fn given(name: &str, value: Value) -> impl FnOnce(&mut Configure) {
    let name = name.to_owned();
    move |configure| {
        configure.parameters.insert(name, value);
    }
}

#[test]
fn a_component_describes_itself_without_an_agent() {
    let mut setup = Setup::new::<Judge>(None);
    Judge::new(&mut setup).unwrap();
    let profile = setup.profile();

    assert_eq!(profile.inputs[0].message_type, "std_msgs/msg/Int32");
    assert_eq!(profile.outputs[0].name.as_str(), "danger");
    let parameters: Vec<&str> =
        profile.parameters.iter().map(|known| known.name.as_str()).collect();
    assert_eq!(parameters, ["score_min", "area", "ballast_bytes"]);
    let (min, max) = (&profile.parameters[0].min, &profile.parameters[0].max);
    assert_eq!((min, max), (&Some(Value::Float(0.0)), &Some(Value::Float(1.0))));
    assert_eq!(profile.parameters[1].min, None);
    let camera = DeviceProfile { name: String::from("camera"), unless: None };
    assert_eq!(profile.devices, [camera]);
}

#[test]
fn configured_values_replace_defaults() {
    let judge = try_new(given("score_min", Value::Int(1))).unwrap();
    assert_eq!((judge.score_min, judge.area), (1.0, vec![vec![0.0, 1.0]]));
}

#[test]
fn what_does_not_fit_is_refused_with_what_is_allowed() {
    let cases = [
        (try_new(given("score_min", Value::Float(1.5))), "is 1.5; allowed: 0 to 1"),
        (try_new(given("score_min", Value::Bool(true))), "true (true or false); allowed: a number"),
        (try_new(given("speed", Value::Int(1))), "`speed` is unknown; there are: score_min, area,"),
        (try_new(given("ballast_bytes", Value::Float(0.5))), "allowed: a whole number"),
        (try_new(|configure| configure.devices.clear()), "device `camera` was not given"),
    ];
    for (result, words) in cases {
        let text = result.err().unwrap();
        assert!(text.contains(words), "{text}");
    }
}
