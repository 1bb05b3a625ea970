//! Two robots on one machine: real shared memory, real DDS.

use std::{
    sync::{Arc, Mutex},
    time::{Duration, Instant},
};

use rustix::event::{PollFd, PollFlags, Timespec, poll};
use sdr_component::shm::{Publisher, Sample, SampleHeader, Subscriber};
use sdr_core::{
    effect::Direction,
    order::{Epoch, Token},
    spec::{Qos, Reliability},
};
use tokio::sync::mpsc::{Receiver, channel};

use super::*;

const PATIENCE: Duration = Duration::from_secs(30);
const PATH: &str = "tunnel/fisheye/image";
const SLICE: Timespec = Timespec { tv_sec: 0, tv_nsec: 20_000_000 };

/// Shared memory of a robot of this test's own; everything is gone afterwards.
pub(super) struct Place {
    memory: SharedMemory,
    _folder: tempfile::TempDir,
}

impl Place {
    pub(super) fn new() -> Self {
        let folder = tempfile::tempdir_in("/dev/shm").unwrap();
        let word = folder.path().file_name().unwrap().to_str().unwrap().replace(".tmp", "");
        let root = folder.path().to_owned();
        Self { memory: SharedMemory { prefix: format!("d{word}_"), root }, _folder: folder }
    }

    pub(super) fn open(&self) -> Memory {
        Memory::open(&self.memory, "test").unwrap()
    }
}

impl Drop for Place {
    fn drop(&mut self) {
        for entry in std::fs::read_dir("/dev/shm").unwrap().flatten() {
            if entry.file_name().to_string_lossy().starts_with(&self.memory.prefix) {
                let _ = std::fs::remove_file(entry.path());
            }
        }
    }
}

/// A DDS domain by chance, below the ports that the kernel gives to others.
pub(super) fn domain() -> u16 {
    u16::try_from(1 + chance() % 99).unwrap()
}

pub(super) fn chance() -> u64 {
    use std::hash::{BuildHasher, Hasher};
    std::hash::RandomState::new().build_hasher().finish()
}

pub(super) fn qos(depth: u8) -> Qos {
    Qos { reliability: Reliability::Reliable, depth, deadline: None }
}

/// Ports and bodies, as the recording got them.
type Tapped = Arc<Mutex<Vec<(String, Vec<u8>)>>>;

struct Robot {
    // Dropped in this order: the bridge before its memory.
    data: Data,
    inputs: Receiver<Input>,
    tapped: Tapped,
    memory: Memory,
    _place: Place,
}

impl Robot {
    fn new(name: &str, domain_id: u16) -> Self {
        let place = Place::new();
        let (sender, inputs) = channel(64);
        let tapped = Arc::new(Mutex::new(Vec::new()));
        let sink = Arc::clone(&tapped);
        let record: TapSink = Box::new(move |sample: TapSample<'_>| {
            sink.lock().unwrap().push((sample.port.to_owned(), sample.body.to_vec()));
        });
        let memory = place.memory.clone();
        let config = DataConfig { robot: robot(name), domain_id, addresses: Vec::new(), memory };
        let data = Data::start(config, sender, record).unwrap();
        Self { data, inputs, tapped, memory: place.open(), _place: place }
    }

    /// Waits until the brain was told that the route has so many peers.
    fn told(&mut self, path: &str, wanted: u16) {
        until(&format!("{wanted} peers of {path}"), || {
            std::iter::from_fn(|| self.inputs.try_recv().ok())
                .any(|input| input == Input::Route { path: path.into(), matched: wanted })
        });
    }

    fn counters(&self, way: Way) -> RouteCounters {
        let all = self.data.counters();
        all.into_iter().find(|(_, found, _)| *found == way).map(|(_, _, found)| found).unwrap()
    }
}

fn robot(name: &str) -> RobotId {
    RobotId::new(name).unwrap()
}

fn until(what: &str, mut holds: impl FnMut() -> bool) {
    let since = Instant::now();
    while !holds() {
        assert!(since.elapsed() < PATIENCE, "waited for {what}");
        thread::sleep(Duration::from_millis(1));
    }
}

fn token(run: u32) -> Token {
    Token { epoch: Epoch { number: 7, minted_by: robot("a-1") }, run }
}

fn route(path: &str, direction: Direction) -> Route {
    let peers = vec![robot("a-1"), robot("b")];
    let message_type = "sensor_msgs/msg/Image".into();
    Route { path: path.into(), message_type, qos: qos(8), direction, peers }
}

fn out(path: &str, run: u32) -> Route {
    route(path, Direction::Out { active: Some(token(run)) })
}

/// Two robots with a route from `a-1` to `b`, matched.
struct Pair {
    a: Robot,
    b: Robot,
    path: String,
    producer: Publisher,
    consumer: Subscriber,
}

impl Pair {
    fn new() -> Self {
        let domain_id = domain();
        let (mut a, mut b) = (Robot::new("a-1", domain_id), Robot::new("b", domain_id));
        let path = format!("{PATH}{}", chance());
        let producer = a.memory.publisher(&path, 8, 64).unwrap();
        let consumer = b.memory.subscriber(&path, 8).unwrap();
        let start = Instant::now();
        a.data.set_routes(vec![out(&path, 1)]);
        b.data.set_routes(vec![route(&path, Direction::In)]);
        a.told(&path, 1);
        b.told(&path, 1);
        println!("matched after {:?}", start.elapsed());
        Self { a, b, path, producer, consumer }
    }

    fn send(&self, run: u32, sequence: u64, body: &[u8]) {
        send(&self.producer, SampleHeader { sequence, ..SampleHeader::new(&token(run)) }, body);
    }

    fn receive(&self) -> Sample {
        receive(&self.consumer)
    }
}

fn send(publisher: &Publisher, header: SampleHeader, body: &[u8]) {
    let mut loan = publisher.loan(body.len()).unwrap();
    loan.payload_mut().copy_from_slice(body);
    loan.send(header).unwrap();
}

fn receive(subscriber: &Subscriber) -> Sample {
    let since = Instant::now();
    loop {
        subscriber.clear_wakes();
        if let Some(sample) = subscriber.receive().unwrap() {
            return sample;
        }
        assert!(since.elapsed() < PATIENCE, "waited for a sample");
        poll(&mut [PollFd::new(subscriber, PollFlags::IN)], Some(&SLICE)).unwrap();
    }
}

#[test]
fn what_the_active_instance_sends_arrives_with_its_token_and_numbers() {
    let pair = Pair::new();

    for (sequence, length) in [(1, 1), (2, 3), (3, 57_603), (4, 300_000)] {
        let body: Vec<u8> = (0..length).map(|n: u32| n.to_le_bytes()[0]).collect();
        let header = SampleHeader {
            sequence,
            tick: 9 + sequence,
            source_time_ns: 123_456_789_012,
            ..SampleHeader::new(&token(1))
        };
        send(&pair.producer, header, &body);

        let sample = pair.receive();
        assert_eq!(sample.payload(), body);
        let flags = SampleHeader::INJECTED;
        assert_eq!(*sample.header(), SampleHeader { flags, ..header });
        assert_eq!(sample.header().token(), Some(token(1)));
    }
    // A sample is counted just after it was handed on.
    until("all to be counted", || {
        pair.a.counters(Way::Out).forwarded == 4 && pair.b.counters(Way::In).injected == 4
    });
    let (out, into) = (pair.a.counters(Way::Out), pair.b.counters(Way::In));
    assert_eq!((out.forwarded, out.forwarded_bytes, out.matched), (4, 357_607, 1));
    assert_eq!((into.injected, into.injected_bytes, into.matched), (4, 357_607, 1));
}

#[test]
fn only_the_active_token_leaves_the_robot_and_the_route_says_which_it_is() {
    let pair = Pair::new();

    pair.send(2, 1, b"too early");
    pair.send(1, 1, b"first");
    assert_eq!(pair.receive().payload(), b"first");

    pair.a.data.set_routes(vec![out(&pair.path, 2)]);
    until("the new token to pass", || {
        pair.send(2, 2, b"second");
        pair.consumer.receive().unwrap().is_some_and(|sample| sample.payload() == b"second")
    });
    let before = pair.a.counters(Way::Out).refused_token;
    pair.send(1, 2, b"too late");
    until("the old token to be refused", || pair.a.counters(Way::Out).refused_token > before);

    pair.a.data.set_routes(vec![route(&pair.path, Direction::Out { active: None })]);
    until("no token to pass", || {
        let before = pair.a.counters(Way::Out);
        pair.send(2, 3, b"nobody is active");
        until("the sample to be judged", || {
            let after = pair.a.counters(Way::Out);
            (after.forwarded, after.refused_token) != (before.forwarded, before.refused_token)
        });
        pair.a.counters(Way::Out).refused_token > before.refused_token
    });
    while let Some(sample) = pair.consumer.receive().unwrap() {
        assert_ne!(sample.payload(), b"too late");
    }
}

#[test]
fn what_a_bridge_put_in_never_leaves_again() {
    let mut pair = Pair::new();
    let both = vec![out(&pair.path, 1), route(&pair.path, Direction::In)];
    pair.a.data.set_routes(both.clone());
    pair.b.data.set_routes(both);
    pair.b.told(&pair.path, 1);
    let listener = pair.a.memory.subscriber(&pair.path, 8).unwrap();

    pair.send(1, 1, b"once");

    assert_eq!(pair.receive().payload(), b"once");
    until("the second bridge to refuse it", || pair.b.counters(Way::Out).refused_injected == 1);
    pair.send(1, 2, b"twice");
    assert_eq!(pair.receive().payload(), b"twice");
    assert_eq!(receive(&listener).payload(), b"once");
    assert_eq!(receive(&listener).payload(), b"twice");
    assert!(listener.receive().unwrap().is_none());
    assert_eq!(pair.b.counters(Way::Out).forwarded, 0);
    assert_eq!(pair.a.counters(Way::In).injected, 0);
}

#[test]
fn a_route_that_is_gone_carries_nothing_and_its_far_end_knows_at_once() {
    let mut pair = Pair::new();

    pair.a.data.set_routes(Vec::new());

    pair.b.told(&pair.path, 0);
    assert_eq!(pair.a.data.counters(), []);
    pair.send(1, 1, b"into the void");
    pair.a.data.set_routes(vec![out(&pair.path, 1)]);
    pair.b.told(&pair.path, 1);
    pair.a.told(&pair.path, 1);
    pair.send(1, 2, b"back again");
    assert_eq!(pair.receive().payload(), b"back again");
}

#[test]
fn samples_of_an_epoch_minted_by_a_stranger_wait_for_its_name() {
    let pair = Pair::new();
    let strange = Token { epoch: Epoch { number: 8, minted_by: robot("stranger") }, run: 1 };
    let direction = Direction::Out { active: Some(strange.clone()) };
    pair.a.data.set_routes(vec![route(&pair.path, direction)]);

    until("a sample to be held", || {
        send(&pair.producer, SampleHeader::new(&strange), b"who?");
        pair.b.counters(Way::In).held > 0
    });
    until("it to be dropped", || pair.b.counters(Way::In).dropped_unnamed > 0);
    assert_eq!(pair.b.counters(Way::In).injected, 0);

    pair.b.data.set_robots(vec![robot("stranger")]);
    until("the name to be known", || {
        send(&pair.producer, SampleHeader::new(&strange), b"me");
        pair.b.counters(Way::In).injected > 0
    });
    assert_eq!(pair.receive().header().token(), Some(strange));
}

#[test]
fn a_tapped_port_goes_to_the_recording() {
    let robot = Robot::new("a-1", domain());
    let producer = robot.memory.publisher("tunnel/fisheye/image", 8, 64).unwrap();
    robot.data.tap(vec!["tunnel.fisheye.image".into(), "tunnel.other.port".into()]);

    until("the tap to be open and a sample to be recorded", || {
        send(&producer, SampleHeader::new(&token(1)), b"a picture");
        !robot.tapped.lock().unwrap().is_empty()
    });

    let first = robot.tapped.lock().unwrap()[0].clone();
    assert_eq!(first, ("tunnel.fisheye.image".into(), b"a picture".to_vec()));
}

#[test]
fn images_at_fifteen_a_second_all_arrive_in_order() {
    let pair = Pair::new();
    let image = vec![0x3c; 57_640];
    let mut latencies = Vec::new();
    for sequence in 1..=45 {
        let sent_at = Instant::now();
        pair.send(1, sequence, &image);
        let sample = pair.receive();
        latencies.push(sent_at.elapsed());
        assert_eq!((sample.header().sequence, sample.payload().len()), (sequence, image.len()));
        // The period of a camera; nothing is judged by it.
        thread::sleep(Duration::from_micros(66_667).saturating_sub(sent_at.elapsed()));
    }
    latencies.sort();
    let (p50, p99) = (latencies[latencies.len() / 2], latencies[latencies.len() - 1]);
    println!("57 kB at 15 Hz, producer to consumer: p50 {p50:?}, max of 45 {p99:?}");
}
