//! Chosen ports of this robot: into the recording, and to the figures of its body.

use std::collections::{BTreeMap, BTreeSet};
use std::sync::{Arc, Mutex, PoisonError};

use sdr_component::message::definition_of;
use sdr_core::{effect::LaunchOrder, spec::ComponentProfile};

use crate::clock;
use crate::data::{TapSample, TapSink};
use crate::metrics::SensorPorts;
use crate::record::RecordSender;

/// The ROS 2 type of each port that was met so far, by `system.component.port`.
#[derive(Clone, Debug, Default)]
pub(crate) struct PortTypes(Arc<Mutex<BTreeMap<String, String>>>);

impl PortTypes {
    /// Learns from what a component says of itself and from what it is wired to.
    pub(crate) fn learn(&self, order: &LaunchOrder, profile: &ComponentProfile) {
        let mut types = self.0.lock().unwrap_or_else(PoisonError::into_inner);
        let key = &order.component;
        for port in &profile.outputs {
            let name = format!("{}.{}.{}", key.system, key.name, port.name);
            types.insert(name, port.message_type.clone());
        }
        for wiring in &order.inputs {
            types.insert(wiring.path.replace('/', "."), wiring.message_type.clone());
        }
    }

    fn of(&self, port: &str) -> Option<String> {
        self.0.lock().unwrap_or_else(PoisonError::into_inner).get(port).cloned()
    }
}

/// Who wants samples of which ports.
#[derive(Debug)]
pub(crate) struct Listeners {
    /// Ports to record.
    pub(crate) recorded: BTreeSet<String>,
    /// Ports with figures of the body.
    pub(crate) sensors: SensorPorts,
}

impl Listeners {
    /// All ports that anybody wants.
    pub(crate) fn ports(&self) -> Vec<String> {
        let all: BTreeSet<_> = self.recorded.iter().cloned().chain(self.sensors.ports()).collect();
        all.into_iter().collect()
    }
}

/// Where the data plane puts samples of tapped ports.
pub(crate) fn sink(types: PortTypes, record: RecordSender, mut listeners: Listeners) -> TapSink {
    Box::new(move |sample: TapSample<'_>| {
        let Some(message_type) = types.of(sample.port) else {
            tracing::debug!(event = "tap-untyped", port = sample.port);
            return;
        };
        listeners.sensors.take(sample.port, &message_type, sample.body);
        if !listeners.recorded.contains(sample.port) {
            return;
        }
        let mut cdr = Vec::with_capacity(sample.body.len() + 4);
        cdr.extend_from_slice(&[0, 1, 0, 0]);
        cdr.extend_from_slice(sample.body);
        let topic = format!("/{}", sample.port.replace('.', "/"));
        let definition = definition_of(&message_type).unwrap_or_default();
        record.message(&topic, &message_type, definition, clock::now().as_nanos(), cdr);
    })
}

#[cfg(test)]
mod tests {
    use sdr_component::message::{Encode as _, Message as _, sensor_msgs::BatteryState};
    use sdr_core::{id::RobotId, units::Permille};

    use super::*;
    use crate::events::Events;
    use crate::metrics::{Sensors, Source};
    use crate::record::Recorder;
    use crate::trouble::Trouble;

    #[test]
    fn a_sensors_port_is_felt_and_only_wished_ports_are_recorded() {
        let robot = RobotId::new("robot-1").unwrap();
        let dir = tempfile::tempdir().unwrap();
        let recorder = Recorder::start(dir.path(), &robot, u64::MAX, |_| {}).unwrap();
        let sensors =
            Sensors { battery: Some(Source::of_port("s.body.battery")), ..Sensors::default() };
        let trouble = Trouble::new(Events::new(robot));
        let listeners = Listeners {
            recorded: BTreeSet::from(["s.body.spare".to_owned()]),
            sensors: SensorPorts::new(sensors.clone(), trouble),
        };
        assert_eq!(listeners.ports(), ["s.body.battery", "s.body.spare"]);
        let types = PortTypes::default();
        for port in listeners.ports() {
            types.0.lock().unwrap().insert(port, BatteryState::TYPE.to_owned());
        }
        let mut sink = sink(types, recorder.sender(), listeners);

        for (port, percentage) in [("s.body.battery", 0.25), ("s.body.spare", 0.75)] {
            let said = BatteryState { percentage, ..BatteryState::default() };
            let mut body = vec![0; said.encoded_len()];
            said.encode(&mut body).unwrap();
            sink(TapSample { port, body: &body });
        }

        assert_eq!(sensors.battery(clock::now()), Some(Permille(250)));
        let bytes = std::fs::read(recorder.flusher().flush()).unwrap();
        let topics: Vec<_> = mcap::MessageStream::new(&bytes)
            .unwrap()
            .map(|message| message.unwrap().channel.topic.clone())
            .collect();
        assert_eq!(topics, ["/s/body/spare"]);
    }
}
