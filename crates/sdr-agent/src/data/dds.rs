//! DDS as the transport between robots: one participant a robot, raw CDR bodies.

mod matching;
mod qos;
mod raw;

use std::{
    cell::RefCell,
    collections::BTreeMap,
    net::{Ipv4Addr, UdpSocket},
    pin::Pin,
    sync::Arc,
    task::{Context, Poll, Waker},
    time::Duration,
};

use bytes::Bytes;
use futures_util::Stream;
use rustdds::{
    DomainParticipant, DomainParticipantBuilder, DomainParticipantStatusListener, GUID, Publisher,
    QosPolicyBuilder, RTPSEntity, SampleIdentity, SequenceNumber, StatusEvented, Subscriber,
    Timestamp, TopicKind, WriteOptionsBuilder,
    dds::{WriteError, no_key::DeserializedCacheChange},
    no_key::{DataWriter, SimpleDataReader},
};

use matching::Matching;
use qos::{policies, writer_policies};
use raw::{CopyInto, Raw};

use super::{
    bell::Bell,
    origin::{Identity, Origin, TRAILER_BYTES},
    transport::{Arrival, EndpointId, Matched, SendError, Topic, Transport, TransportError, Way},
};

/// Ports of one domain (RTPS 2.3, section 9.6.1.1).
const DOMAIN_PORTS: u16 = 250;
/// Port for samples to all, of domain 0.
const SAMPLES_PORT: u16 = 7401;
/// Largest body that is surely not fragmented, on links with an MTU of 576 and more.
const WHOLE_BYTES_MAX: usize = 440;
/// Bytes a reliable writer may hold while some reader acknowledges nothing.
const UNACKNOWLEDGED_BYTES_MAX: u64 = 32 << 20;

/// The participant of this robot and its endpoints.
pub(crate) struct Dds {
    participant: DomainParticipant,
    publisher: Publisher,
    subscriber: Subscriber,
    status: DomainParticipantStatusListener,
    waker: Waker,
    matching: Matching,
    endpoints: BTreeMap<EndpointId, Endpoint>,
    endpoints_made: EndpointId,
}

enum Endpoint {
    Writer(Writer),
    Reader(SimpleDataReader<(), Raw>),
}

struct Writer {
    writer: DataWriter<Bytes, Raw>,
    topic: Topic,
    unacknowledged_bytes: u64,
}

/// Holds the port on which a participant would hear samples sent to all, while it is made: it then
/// announces none, and samples come to it alone.
///
/// A writer prefers to send to all when a reader allows it. By Wi-Fi that is the slowest rate and no
/// retry: pictures that way filled the air and were lost. Discovery has another port and stays as it
/// is. `None` when somebody else holds the port; then nothing is different from before.
fn hold_multicast_port(domain_id: u16) -> Option<UdpSocket> {
    let port = domain_id.checked_mul(DOMAIN_PORTS)?.checked_add(SAMPLES_PORT)?;
    UdpSocket::bind((Ipv4Addr::UNSPECIFIED, port)).ok()
}

impl Dds {
    /// Joins a DDS domain by these addresses of the robot, or by all it has; takes some tens
    /// of milliseconds.
    pub(crate) fn join(
        domain_id: u16,
        addresses: &[Ipv4Addr],
        bell: &Arc<Bell>,
    ) -> Result<Self, TransportError> {
        let failed = |reason: rustdds::dds::CreateError| {
            TransportError::new(format!("join DDS domain {domain_id}"), reason)
        };
        let qos = QosPolicyBuilder::new().build();
        let mut builder = DomainParticipantBuilder::new(domain_id);
        if !addresses.is_empty() {
            builder = builder.with_only_networks(addresses.iter().copied());
        }
        let participant = {
            let _held = hold_multicast_port(domain_id);
            builder.build().map_err(failed)?
        };
        let publisher = participant.create_publisher(&qos).map_err(failed)?;
        let subscriber = participant.create_subscriber(&qos).map_err(failed)?;
        Ok(Self {
            publisher,
            subscriber,
            status: participant.status_listener(),
            waker: Waker::from(Arc::clone(bell)),
            matching: Matching::new(participant.guid()),
            participant,
            endpoints: BTreeMap::new(),
            endpoints_made: 0,
        })
    }

    fn make_writer(&self, topic: &Topic) -> Result<DataWriter<Bytes, Raw>, TransportError> {
        let failed = |reason| TransportError::new(format!("write topic rt/{}", topic.path), reason);
        let qos = policies(topic.qos);
        let dds_topic = self
            .participant
            .create_topic(name(topic), type_name(&topic.message_type), &qos, TopicKind::NoKey)
            .map_err(failed)?;
        let qos = writer_policies(topic.qos);
        self.publisher.create_datawriter_no_key(&dds_topic, Some(qos)).map_err(failed)
    }

    fn make_reader(&self, topic: &Topic) -> Result<SimpleDataReader<(), Raw>, TransportError> {
        let failed = |reason| TransportError::new(format!("read topic rt/{}", topic.path), reason);
        let qos = policies(topic.qos);
        let dds_topic = self
            .participant
            .create_topic(name(topic), type_name(&topic.message_type), &qos, TopicKind::NoKey)
            .map_err(failed)?;
        let reader = self
            .subscriber
            .create_simple_datareader_no_key(&dds_topic, Some(qos))
            .map_err(failed)?;
        reader.set_waker(Some(self.waker.clone()));
        Ok(reader)
    }

    /// Replaces a writer by a fresh one with nothing unacknowledged.
    ///
    /// A reader that died without a word stays matched until its lease of 50 s ends. All that
    /// time the writer keeps every sample for it, and once the window is full it would refuse
    /// samples for the living readers too. A new writer starts with an empty window.
    fn renew(&mut self, endpoint: EndpointId) {
        let Some(Endpoint::Writer(old)) = self.endpoints.get(&endpoint) else { return };
        let topic = old.topic.clone();
        match self.make_writer(&topic) {
            Ok(writer) => {
                tracing::warn!(event = "writer-renewed", path = topic.path, "a reader is silent");
                self.matching.remove(old_guid(&self.endpoints, endpoint));
                self.matching.add(writer.guid(), endpoint);
                let fresh = Writer { writer, topic, unacknowledged_bytes: 0 };
                self.endpoints.insert(endpoint, Endpoint::Writer(fresh));
            }
            Err(error) => tracing::warn!(%error, "writer stays as it is"),
        }
    }

    /// Writes to all readers at once, or to each by itself where one of them is our own.
    fn write(&mut self, endpoint: EndpointId, sample: &Outgoing) -> Result<(), SendError> {
        let Some(Endpoint::Writer(writer)) = self.endpoints.get_mut(&endpoint) else {
            return Err(SendError::Broken(format!("endpoint {endpoint} is not open for writing")));
        };
        match self.matching.one_by_one(endpoint) {
            None => writer.write(sample, None),
            Some(readers) => {
                readers.iter().try_for_each(|reader| writer.write(sample, Some(*reader)))
            }
        }
    }
}

impl Writer {
    fn write(&mut self, sample: &Outgoing, reader: Option<GUID>) -> Result<(), SendError> {
        let mut options = WriteOptionsBuilder::new()
            .related_sample_identity_opt(sample.related)
            .source_timestamp(sample.timestamp);
        if let Some(reader) = reader {
            options = options.to_single_reader(reader);
        }
        match self.writer.write_with_options(sample.body.clone(), options.build()) {
            Ok(_) => {
                self.unacknowledged_bytes += sample.body.len() as u64;
                Ok(())
            }
            Err(WriteError::WouldBlock { .. }) => Err(SendError::Backlog),
            Err(
                error @ (WriteError::Serialization { .. }
                | WriteError::Poisoned { .. }
                | WriteError::Io(_)
                | WriteError::Internal { .. }),
            ) => Err(SendError::Broken(error.to_string())),
        }
    }
}

impl Transport for Dds {
    fn open(&mut self, way: Way, topic: &Topic) -> Result<EndpointId, TransportError> {
        let id = self.endpoints_made + 1;
        let (guid, endpoint) = match way {
            Way::Out => {
                let writer = self.make_writer(topic)?;
                let topic = topic.clone();
                let guid = writer.guid();
                (guid, Endpoint::Writer(Writer { writer, topic, unacknowledged_bytes: 0 }))
            }
            Way::In => {
                let reader = self.make_reader(topic)?;
                (reader.guid(), Endpoint::Reader(reader))
            }
        };
        self.endpoints_made = id;
        self.matching.add(guid, id);
        self.endpoints.insert(id, endpoint);
        Ok(id)
    }

    fn close(&mut self, endpoint: EndpointId) {
        if self.endpoints.contains_key(&endpoint) {
            self.matching.remove(old_guid(&self.endpoints, endpoint));
            self.endpoints.remove(&endpoint);
        }
    }

    fn send(
        &mut self,
        endpoint: EndpointId,
        origin: &Origin,
        body: &[u8],
    ) -> Result<(), SendError> {
        let Some(identity) = origin.to_identity(body.len()) else {
            return Err(SendError::Broken(format!("{origin:?} has a number out of range")));
        };
        let sample = Outgoing::new(&identity, body);
        match self.write(endpoint, &sample) {
            Err(SendError::Backlog) => {
                self.renew(endpoint);
                self.write(endpoint, &sample)
            }
            done @ (Ok(()) | Err(SendError::Broken(_))) => done,
        }
    }

    fn receive(&mut self, endpoint: EndpointId, body: &mut Vec<u8>) -> Option<Arrival> {
        let Some(Endpoint::Reader(reader)) = self.endpoints.get(&endpoint) else { return None };
        let buffer = RefCell::new(std::mem::take(body));
        let mut taken = reader.try_take_one_with(CopyInto(&buffer));
        if matches!(taken, Ok(None)) {
            // The waker goes with each wake-up; set again, then look again, so that nothing
            // slips in between.
            reader.set_waker(Some(self.waker.clone()));
            taken = reader.try_take_one_with(CopyInto(&buffer));
        }
        *body = buffer.into_inner();
        match taken {
            Ok(None) => None,
            Ok(Some(change)) => Some(arrival(&change, self.participant.guid(), body)),
            Err(_) => Some(Arrival::Undecodable),
        }
    }

    fn poll_matched(&mut self) -> Option<Matched> {
        let mut context = Context::from_waker(&self.waker);
        let mut events = self.status.as_async_status_stream();
        while let Poll::Ready(Some(event)) = Pin::new(&mut events).poll_next(&mut context) {
            self.matching.handle(&event);
        }
        self.matching.poll()
    }

    fn sweep(&mut self) {
        let mut overdue = Vec::new();
        for (id, endpoint) in &mut self.endpoints {
            match endpoint {
                Endpoint::Writer(writer) => {
                    if matches!(writer.writer.wait_for_acknowledgments(Duration::ZERO), Ok(true)) {
                        writer.unacknowledged_bytes = 0;
                    } else if writer.unacknowledged_bytes > UNACKNOWLEDGED_BYTES_MAX {
                        overdue.push(*id);
                    }
                }
                Endpoint::Reader(reader) => reader.drain_read_notifications(),
            }
        }
        for endpoint in overdue {
            self.renew(endpoint);
        }
    }
}

/// A sample as it is written; kept apart so that it can be written twice.
///
/// A body that fits one datagram stays pure, with its origin as *related sample identity*.
/// RustDDS garbles fragments that carry one, so a larger body has its origin at its end. To a
/// reader of CDR those bytes are members that a later version of the type has appended.
struct Outgoing {
    related: Option<SampleIdentity>,
    timestamp: Timestamp,
    body: Bytes,
}

impl Outgoing {
    fn new(identity: &Identity, body: &[u8]) -> Self {
        let timestamp = Timestamp::from_ticks(identity.timestamp);
        if body.len() <= WHOLE_BYTES_MAX {
            let related = SampleIdentity {
                writer_guid: GUID::from_bytes(identity.guid),
                sequence_number: SequenceNumber::new(identity.sequence),
            };
            return Self { related: Some(related), timestamp, body: Bytes::copy_from_slice(body) };
        }
        let padded = body.len().next_multiple_of(4);
        let mut long = Vec::with_capacity(padded + TRAILER_BYTES);
        long.extend_from_slice(body);
        long.resize(padded, 0);
        long.extend_from_slice(&identity.to_trailer());
        Self { related: None, timestamp, body: long.into() }
    }
}

fn arrival(change: &DeserializedCacheChange<()>, participant: GUID, body: &mut Vec<u8>) -> Arrival {
    if change.writer_guid().prefix == participant.prefix {
        return Arrival::Own;
    }
    let identity = match (change.related_sample_identity(), change.source_timestamp()) {
        (Some(related), Some(timestamp)) => Identity {
            guid: related.writer_guid.to_bytes(),
            sequence: i64::from(related.sequence_number),
            timestamp: timestamp.to_ticks(),
        },
        (_, _) => match Identity::from_trailer(body) {
            Some(identity) => {
                body.truncate(body.len() - TRAILER_BYTES);
                identity
            }
            None => return Arrival::Foreign,
        },
    };
    body.truncate(identity.body_bytes(body.len()));
    Arrival::Sample(Origin::from_identity(&identity))
}

fn old_guid(endpoints: &BTreeMap<EndpointId, Endpoint>, endpoint: EndpointId) -> GUID {
    match endpoints.get(&endpoint) {
        Some(Endpoint::Writer(writer)) => writer.writer.guid(),
        Some(Endpoint::Reader(reader)) => reader.guid(),
        None => GUID::GUID_UNKNOWN,
    }
}

fn name(topic: &Topic) -> String {
    format!("rt/{}", topic.path)
}

/// `sensor_msgs/msg/Image` as DDS knows it: `sensor_msgs::msg::dds_::Image_`.
fn type_name(message_type: &str) -> String {
    match message_type.rsplit_once('/') {
        Some((package, message)) => {
            format!("{}::dds_::{message}_", package.replace('/', "::"))
        }
        None => message_type.to_string(),
    }
}

#[cfg(test)]
mod tests;
