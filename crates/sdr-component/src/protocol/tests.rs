//! What is said survives the wire; what is not understood is said to be so.

use proptest::prelude::*;

use sdr_core::{
    order::Epoch,
    recover::Cause,
    spec::{Qos, Reliability},
};

use super::*;

fn key() -> ComponentKey {
    ComponentKey::new(&Name::new("exploration").unwrap(), &Name::new("anomaly").unwrap())
}

fn token() -> Token {
    Token { epoch: Epoch::first(&RobotId::new("robot-1").unwrap()), run: 3 }
}

fn configure() -> Configure {
    Configure {
        v: PROTOCOL_VERSION,
        component: key(),
        parameters: BTreeMap::from([
            (String::from("object"), Value::Text(String::from("red_box"))),
            (String::from("score_min"), Value::Float(0.8)),
        ]),
        devices: BTreeMap::from([(String::from("camera"), String::from("/run/camera.sock"))]),
        inputs: vec![InputWiring {
            port: Name::new("image").unwrap(),
            connection: 0,
            path: String::from("exploration/fisheye/image"),
            message_type: String::from("sensor_msgs/msg/Image"),
            qos: Qos {
                reliability: Reliability::BestEffort,
                depth: 4,
                deadline: Some(Duration::from_millis(100)),
            },
        }],
        output_depth: 8,
        memory: SharedMemory {
            prefix: String::from("rw01234567_"),
            root: PathBuf::from("/dev/shm/rw/01234567"),
        },
        execution: ExecutionSetup::Periodic { period_us: 66_667 },
    }
}

fn through<T: Serialize + serde::de::DeserializeOwned>(message: &T) -> T {
    let mut buffer = LineBuffer::default();
    buffer.push(&encode_line(message).unwrap());
    buffer.next_message().unwrap().unwrap()
}

#[test]
fn every_order_to_a_component_survives_the_wire() {
    let messages = [
        ToComponent::Configure(Box::new(configure())),
        ToComponent::Command(Order::Activate { token: token() }),
        ToComponent::Command(Order::Deactivate),
        ToComponent::Command(Order::Finish),
        ToComponent::Command(Order::Reset),
        ToComponent::Reconfigure(Reconfigure {
            parameters: configure().parameters,
            execution: Some(ExecutionSetup::OnData),
        }),
        ToComponent::Error(ErrorReport { message: String::from("line 1: no") }),
    ];
    for message in messages {
        assert_eq!(through(&message), message);
    }
}

#[test]
fn every_word_of_a_component_survives_the_wire() {
    let fault = Fault { cause: Cause::HardwareLost, reason: String::from("no camera") };
    let now = StateReport { state: LifecycleState::Error, token: None, fault: Some(fault) };
    let profile = ComponentProfile {
        name: String::from("anomaly"),
        about: String::new(),
        inputs: Vec::new(),
        outputs: Vec::new(),
        parameters: Vec::new(),
        devices: Vec::new(),
    };
    let hello = Hello {
        v: PROTOCOL_VERSION,
        component: key(),
        instance: 7,
        pid: 4711,
        badge: None,
        profile,
        now: now.clone(),
    };
    let messages = [
        FromComponent::Hello(Box::new(hello)),
        FromComponent::State(now),
        FromComponent::Heard(Heard { connection: 0, token: token(), at_ns: 5 }),
        FromComponent::Beat(Beat { ticks: 9, late: 1, period_worst_ns: 2, execute_worst_ns: 3 }),
        FromComponent::Counters(Counters::default()),
    ];
    for message in messages {
        assert_eq!(through(&message), message);
    }
}

#[test]
fn a_key_is_read_as_it_is_written() {
    let pinned = ComponentKey { scope: Some(RobotId::new("robot-2").unwrap()), ..key() };
    for key in [key(), pinned] {
        assert_eq!(parse_component_key(&key.to_string()), Ok(key));
    }
    for bad in ["", "anomaly", "a/b/c", "a/B", "a/b@"] {
        assert!(parse_component_key(bad).is_err(), "{bad}");
    }
}

#[test]
fn an_order_reads_as_the_document_says() {
    let line = r#"{"type":"command","do":"activate","token":{"epoch":{"number":1,"minted_by":"robot-1"},"run":3}}"#;
    let expected = ToComponent::Command(Order::Activate { token: token() });
    assert_eq!(serde_json::from_str::<ToComponent>(line).unwrap(), expected);
    assert_eq!(serde_json::to_string(&expected).unwrap(), line);
}

#[test]
fn a_malformed_line_is_named_by_its_number_and_beginning() {
    let mut buffer = LineBuffer::default();
    buffer.push(b"{\"type\":\"command\",\"do\":\"reset\"}\n\n{\"type\":\"sing\"}\n");

    assert!(buffer.next_message::<ToComponent>().unwrap().is_some());
    let error = buffer.next_message::<ToComponent>().unwrap_err().to_string();

    assert!(error.contains("line 3") && error.contains("sing"), "{error}");
}

#[test]
fn a_line_without_end_is_refused_at_the_bound() {
    let mut buffer = LineBuffer::default();
    buffer.push(&vec![b'x'; LINE_BYTES_MAX - 1]);
    assert!(buffer.next_message::<ToComponent>().unwrap().is_none());
    buffer.push(b"xx\n");
    assert!(matches!(buffer.next_message::<ToComponent>(), Err(LineError::TooLong { .. })));
}

proptest! {
    #[test]
    fn no_bytes_make_the_reader_panic(bytes in prop::collection::vec(any::<u8>(), 0..300)) {
        let mut buffer = LineBuffer::default();
        buffer.push(&bytes);
        while let Ok(Some(_)) = buffer.next_message::<FromComponent>() {}
    }
}
