//! One output of another robot on its way to local consumers.

use std::{
    collections::{BTreeMap, VecDeque},
    sync::Arc,
    time::{Duration, Instant},
};

use sdr_component::shm::{Memory, Publisher, SampleHeader, ShmError};
use sdr_core::{
    id::RobotId,
    order::{Epoch, Token},
};

use super::{
    complaint::Complaint,
    counters::Counts,
    origin::{Origin, RobotHash},
    out_route::Left,
    transport::{Arrival, EndpointId, Topic, Transport, TransportError, Way},
};

/// How long a sample waits until the robot that minted its epoch is known.
const HOLD: Duration = Duration::from_millis(200);
/// Most samples received before others get their turn.
const TURN_MAX: usize = 64;
/// First allocation for samples; it grows by itself.
const SIZE_HINT_BYTES: usize = 4096;

/// Robots by the hash of their name.
#[derive(Debug, Default)]
pub(super) struct Names(BTreeMap<RobotHash, SampleHeader>);

impl Names {
    pub(super) fn of<'a>(robots: impl Iterator<Item = &'a RobotId>) -> Self {
        let header = |robot: &RobotId| {
            let epoch = Epoch { number: 0, minted_by: robot.clone() };
            SampleHeader::new(&Token { epoch, run: 0 })
        };
        Self(robots.map(|robot| (RobotHash::of(robot), header(robot))).collect())
    }

    /// The header of a sample of this origin; `None` while its minter has no name here.
    fn header(&self, origin: &Origin) -> Option<SampleHeader> {
        self.0.get(&origin.minter).map(|named| SampleHeader {
            epoch: origin.epoch,
            run: origin.run,
            flags: SampleHeader::INJECTED,
            sequence: origin.sequence,
            tick: origin.tick,
            source_time_ns: origin.source_time_ns,
            ..*named
        })
    }
}

/// Puts what arrives into shared memory.
pub(super) struct InRoute {
    pub(super) topic: Topic,
    sink: Option<Publisher>,
    endpoint: Option<EndpointId>,
    held: VecDeque<Held>,
    counts: Arc<Counts>,
    complaint: Complaint,
}

struct Held {
    origin: Origin,
    body: Vec<u8>,
    until: Instant,
}

impl InRoute {
    pub(super) fn new(topic: Topic, counts: Arc<Counts>) -> Self {
        Self {
            topic,
            sink: None,
            endpoint: None,
            held: VecDeque::new(),
            counts,
            complaint: Complaint::default(),
        }
    }

    /// Opens what is not open yet; what fails is tried again at the next call.
    pub(super) fn open(&mut self, memory: &Memory, transport: Option<&mut (dyn Transport + '_)>) {
        if self.sink.is_none() {
            match memory.publisher(&self.topic.path, self.topic.qos.depth, SIZE_HINT_BYTES) {
                Ok(sink) => self.sink = Some(sink),
                Err(error) => self.complaint.say("route-closed", &self.topic.path, &error),
            }
        }
        if let (None, Some(transport)) = (self.endpoint, transport) {
            let opened: Result<_, TransportError> = transport.open(Way::In, &self.topic);
            match opened {
                Ok(endpoint) => self.endpoint = Some(endpoint),
                Err(error) => self.complaint.say("route-closed", &self.topic.path, &error),
            }
        }
    }

    pub(super) fn close(&mut self, transport: Option<&mut (dyn Transport + '_)>) {
        if let (Some(endpoint), Some(transport)) = (self.endpoint.take(), transport) {
            transport.close(endpoint);
        }
    }

    /// Takes in what arrived, for one turn; `buffer` is scratch.
    pub(super) fn receive(
        &mut self,
        transport: &mut dyn Transport,
        names: &Names,
        buffer: &mut Vec<u8>,
    ) -> Left {
        let Some(endpoint) = self.endpoint else { return Left::Nothing };
        for _ in 0..TURN_MAX {
            match transport.receive(endpoint, buffer) {
                Some(Arrival::Sample(origin)) => match names.header(&origin) {
                    Some(header) => self.inject(header, buffer),
                    None => self.hold(origin, buffer),
                },
                Some(Arrival::Foreign | Arrival::Undecodable) => {
                    self.counts.dropped_foreign.add(1);
                    self.complaint.say("sample-foreign", &self.topic.path, &"not from a bridge");
                }
                Some(Arrival::Own) => {}
                None => return Left::Nothing,
            }
        }
        Left::Samples
    }

    /// Lets go of held samples: those whose minter has a name by now, and those that waited
    /// long enough.
    pub(super) fn release(&mut self, names: &Names, now: Instant) {
        for held in std::mem::take(&mut self.held) {
            if let Some(header) = names.header(&held.origin) {
                self.inject(header, &held.body);
            } else if held.until <= now {
                self.drop_unnamed();
            } else {
                self.held.push_back(held);
            }
        }
    }

    /// When [`InRoute::release`] has something to do again.
    pub(super) fn next_deadline(&self) -> Option<Instant> {
        self.held.front().map(|held| held.until)
    }

    pub(super) fn is_endpoint(&self, endpoint: EndpointId) -> bool {
        self.endpoint == Some(endpoint)
    }

    pub(super) fn counts(&self) -> &Counts {
        &self.counts
    }

    fn hold(&mut self, origin: Origin, body: &[u8]) {
        self.counts.held.add(1);
        if self.held.len() >= usize::from(self.topic.qos.depth.max(1)) {
            self.held.pop_front();
            self.drop_unnamed();
        }
        let until = Instant::now() + HOLD;
        self.held.push_back(Held { origin, body: body.to_vec(), until });
    }

    fn drop_unnamed(&mut self) {
        self.counts.dropped_unnamed.add(1);
        let reason = "their epoch was minted by a robot that is not known here";
        self.complaint.say("sample-unnamed", &self.topic.path, &reason);
    }

    fn inject(&mut self, header: SampleHeader, body: &[u8]) {
        let Some(sink) = &self.sink else { return self.counts.dropped_memory.add(1) };
        let sent: Result<usize, ShmError> = sink.loan(body.len()).and_then(|mut loan| {
            loan.payload_mut().copy_from_slice(body);
            loan.send(header)
        });
        match sent {
            Ok(_) => {
                self.counts.injected_bytes.add(body.len() as u64);
                self.counts.injected.add(1);
            }
            Err(error) => {
                self.counts.dropped_memory.add(1);
                self.complaint.say("sample-unplaced", &self.topic.path, &error);
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::data::tests::{Place, qos};

    fn origin(sequence: u64, minter: &RobotId) -> Origin {
        let minter = RobotHash::of(minter);
        Origin { epoch: 3, minter, run: 2, sequence, tick: 0, source_time_ns: 1 }
    }

    #[test]
    fn a_sample_waits_for_the_name_of_its_minter_and_not_longer_than_a_moment() {
        let place = Place::new();
        let memory = place.open();
        let reader = memory.subscriber("s/c/p", 8).unwrap();
        let message_type = "std_msgs/msg/String".into();
        let topic = Topic { path: "s/c/p".into(), message_type, qos: qos(3) };
        let mut route = InRoute::new(topic, Arc::default());
        route.open(&memory, None);
        let (known, unknown) = (RobotId::new("r1").unwrap(), RobotId::new("r2").unwrap());
        route.hold(origin(1, &unknown), b"one");
        route.hold(origin(2, &known), b"two");
        let now = Instant::now();

        route.release(&Names::default(), now);
        assert!(reader.receive().unwrap().is_none());

        route.release(&Names::of([&known].into_iter()), now);
        let sample = reader.receive().unwrap().unwrap();
        assert_eq!(sample.payload(), b"two");
        assert!(sample.header().is_injected());
        let token = Token { epoch: Epoch { number: 3, minted_by: known }, run: 2 };
        assert_eq!((sample.header().token(), sample.header().sequence), (Some(token), 2));
        assert!(route.next_deadline().is_some());

        route.release(&Names::default(), now + HOLD);
        assert_eq!(route.next_deadline(), None);
        assert!(reader.receive().unwrap().is_none());
    }

    #[test]
    fn no_more_are_held_than_the_queue_is_deep() {
        let topic = Topic { path: "s/c/p".into(), message_type: String::new(), qos: qos(3) };
        let mut route = InRoute::new(topic, Arc::default());
        let unknown = RobotId::new("r2").unwrap();

        for sequence in 1..=5 {
            route.hold(origin(sequence, &unknown), b"");
        }

        let held: Vec<_> = route.held.iter().map(|held| held.origin.sequence).collect();
        assert_eq!(held, [3, 4, 5]);
    }
}
