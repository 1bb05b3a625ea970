//! Two participants on one machine, through real sockets.

use std::time::{Duration, Instant};

use rustix::event::{PollFd, PollFlags, Timespec, poll};
use sdr_core::{
    id::RobotId,
    spec::{Qos, Reliability},
};

use super::*;
use crate::data::{
    origin::RobotHash,
    tests::{chance, domain},
};

const PATIENCE: Duration = Duration::from_secs(30);

struct End {
    dds: Dds,
    bell: Arc<Bell>,
}

impl End {
    fn join(domain_id: u16) -> Self {
        let bell = Arc::new(Bell::new().unwrap());
        Self { dds: Dds::join(domain_id, &[], &bell).unwrap(), bell }
    }

    fn wait(&mut self) {
        let slice = Timespec { tv_sec: 0, tv_nsec: 50_000_000 };
        let _ = poll(&mut [PollFd::new(&*self.bell, PollFlags::IN)], Some(&slice)).unwrap();
        self.bell.hush();
    }

    fn matched(&mut self, wanted: Matched) {
        let since = Instant::now();
        loop {
            while let Some(found) = self.dds.poll_matched() {
                if found == wanted {
                    return;
                }
            }
            assert!(since.elapsed() < PATIENCE, "waited for {wanted:?}");
            self.wait();
        }
    }

    fn receive(&mut self, endpoint: EndpointId, body: &mut Vec<u8>) -> Arrival {
        let since = Instant::now();
        loop {
            if let Some(arrival) = self.dds.receive(endpoint, body) {
                return arrival;
            }
            assert!(since.elapsed() < PATIENCE, "waited for a sample");
            self.wait();
        }
    }
}

fn topic(path: &str, reliability: Reliability) -> Topic {
    let qos = Qos { reliability, depth: 8, deadline: None };
    Topic { path: path.into(), message_type: "std_msgs/msg/ByteMultiArray".into(), qos }
}

fn origin(sequence: u64) -> Origin {
    Origin {
        epoch: 0x2123_4567_89ab,
        minter: RobotHash::of(&RobotId::new("robot-1").unwrap()),
        run: 0xdead_beef,
        sequence,
        tick: sequence * 3_000_000_000,
        source_time_ns: 1_700_000_000_123_456_789,
    }
}

fn joined(reliability: Reliability) -> (End, EndpointId, End, EndpointId) {
    let domain_id = domain();
    let (mut left, mut right) = (End::join(domain_id), End::join(domain_id));
    let topic = topic(&format!("test/c{}/out", chance()), reliability);
    let writer = left.dds.open(Way::Out, &topic).unwrap();
    let reader = right.dds.open(Way::In, &topic).unwrap();
    left.matched(Matched { endpoint: writer, count: 1 });
    right.matched(Matched { endpoint: reader, count: 1 });
    (left, writer, right, reader)
}

#[test]
fn types_are_named_as_ros_2_names_them() {
    assert_eq!(type_name("sensor_msgs/msg/Image"), "sensor_msgs::msg::dds_::Image_");
    assert_eq!(type_name("sdr_msgs/msg/Anomaly"), "sdr_msgs::msg::dds_::Anomaly_");
}

#[test]
fn bodies_of_any_length_and_their_origins_arrive_as_they_were_sent() {
    let (mut left, writer, mut right, reader) = joined(Reliability::Reliable);

    for (sequence, length) in
        [0, 1, 2, 3, 4, 5, 255, 440, 441, 1400, 1499, 57_603, 300_001].iter().enumerate()
    {
        let sent: Vec<u8> = (0..*length).map(|n: u32| n.to_le_bytes()[0] ^ 0x5a).collect();
        let origin = origin(sequence as u64);
        left.dds.send(writer, &origin, &sent).unwrap();

        let mut body = Vec::new();
        assert_eq!(right.receive(reader, &mut body), Arrival::Sample(origin));
        assert_eq!(body.len(), sent.len());
        assert_eq!(body, sent);
    }
}

#[test]
fn closing_an_endpoint_is_seen_at_the_far_end_at_once() {
    let (mut left, writer, mut right, reader) = joined(Reliability::BestEffort);

    left.dds.close(writer);

    right.matched(Matched { endpoint: reader, count: 0 });
    assert!(left.dds.send(writer, &origin(1), b"").is_err());
}

#[test]
fn a_renewed_writer_finds_its_reader_again() {
    let (mut left, writer, mut right, reader) = joined(Reliability::Reliable);
    let mut body = Vec::new();

    left.dds.renew(writer);
    left.matched(Matched { endpoint: writer, count: 1 });
    right.matched(Matched { endpoint: reader, count: 1 });
    left.dds.send(writer, &origin(9), b"anew").unwrap();

    assert_eq!(right.receive(reader, &mut body), Arrival::Sample(origin(9)));
    assert_eq!(body, b"anew");
}

#[test]
fn a_writer_with_a_reader_of_our_own_sends_to_the_others_alone() {
    let (mut left, writer, mut right, reader) = joined(Reliability::Reliable);
    let Some(Endpoint::Writer(open)) = left.dds.endpoints.get(&writer) else { unreachable!() };
    let topic = open.topic.clone();
    let echo = left.dds.open(Way::In, &topic).unwrap();
    let since = Instant::now();
    while left.dds.matching.one_by_one(writer).is_none() {
        assert!(since.elapsed() < PATIENCE, "waited for our own two to be joined");
        while left.dds.poll_matched().is_some() {}
        left.wait();
    }

    let mut body = Vec::new();
    for sequence in 1..=20 {
        left.dds.send(writer, &origin(sequence), &[7; 10_000]).unwrap();
        assert_eq!(right.receive(reader, &mut body), Arrival::Sample(origin(sequence)));
    }

    assert_eq!(left.dds.receive(echo, &mut body), None);
}
