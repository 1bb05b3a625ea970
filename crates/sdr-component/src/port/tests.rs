//! Two ports over real shared memory.

use sdr_core::{
    effect::InputWiring,
    id::RobotId,
    order::Epoch,
    spec::{Qos, Reliability},
};

use super::*;
use crate::message::sensor_msgs::{Image, ImageView};
use crate::message::{Message, std_msgs::Int32};
use crate::shm::{Memory, SampleHeader};
use crate::testing::Place;
use sdr_core::{id::Name, order::Token};

fn token(number: u64, run: u32) -> Token {
    Token { epoch: Epoch { number, minted_by: RobotId::new("robot-1").unwrap() }, run }
}

fn input<M: Message>(memory: &Memory, depth: u8) -> (SharedInput, InPort<M>) {
    let wiring = InputWiring {
        port: Name::new("value").unwrap(),
        connection: 4,
        path: String::from("s/c/value"),
        message_type: M::TYPE.to_owned(),
        qos: Qos { reliability: Reliability::Reliable, depth, deadline: None },
    };
    let subscriber = memory.subscriber(&wiring.path, depth).unwrap();
    let core = InputCore::new::<M>(vec![Connection::new(wiring, subscriber)]);
    let shared = SharedInput::new(core);
    shared.lock().listen();
    (shared.clone(), InPort::new(shared))
}

fn output<M: Message>(memory: &Memory) -> (SharedOutput, OutPort<M>) {
    let publisher = memory.publisher("s/c/value", 8, 64).unwrap();
    let core = OutputCore::new(Name::new("value").unwrap(), Some(publisher));
    let shared = SharedOutput::new(core);
    (shared.clone(), OutPort::new(shared))
}

fn all(port: &mut InPort<Int32>) -> Vec<i32> {
    std::iter::from_fn(|| port.receive().map(|sample| sample.message().unwrap().data)).collect()
}

#[test]
fn an_inactive_instance_never_writes() {
    let place = Place::new();
    let memory = Memory::open(&place.memory, "test").unwrap();
    let (shared, out) = output::<Int32>(&memory);
    let (_, mut input) = input::<Int32>(&memory, 8);

    assert!(matches!(out.send(&Int32 { data: 1 }), Err(PortError::Inactive { .. })));
    shared.lock().set_token(Some(&token(1, 1)));
    out.send(&Int32 { data: 2 }).unwrap();
    shared.lock().set_token(None);
    assert!(out.send(&Int32 { data: 3 }).is_err());

    assert_eq!(all(&mut input), [2]);
}

#[test]
fn after_the_first_sample_of_a_new_home_the_old_one_is_refused_and_counted() {
    let place = Place::new();
    let memory = Memory::open(&place.memory, "test").unwrap();
    let (old_shared, old) = output::<Int32>(&memory);
    let (new_shared, new) = output::<Int32>(&memory);
    let (shared, mut input) = input::<Int32>(&memory, 8);
    old_shared.lock().set_token(Some(&token(1, 7)));
    new_shared.lock().set_token(Some(&token(2, 1)));

    old.send(&Int32 { data: 1 }).unwrap();
    assert_eq!(all(&mut input), [1]);
    new.send(&Int32 { data: 2 }).unwrap();
    assert_eq!(all(&mut input), [2]);
    old.send(&Int32 { data: 3 }).unwrap();
    assert_eq!(all(&mut input), [] as [i32; 0]);

    let mut core = shared.lock();
    let tokens: Vec<Token> = core.heard.drain(..).map(|heard| heard.token).collect();
    assert_eq!(tokens, [token(1, 7), token(2, 1)]);
    let counters = core.connections[0].statistics.take(0);
    assert_eq!((counters.accepted, counters.fenced, counters.lost, counters.epoch), (2, 1, 0, 2));
}

#[test]
fn a_reader_that_falls_behind_keeps_the_newest() {
    let place = Place::new();
    let memory = Memory::open(&place.memory, "test").unwrap();
    let (shared, out) = output::<Int32>(&memory);
    let (core, mut input) = input::<Int32>(&memory, 3);
    shared.lock().set_token(Some(&token(1, 1)));

    for data in 1..=10 {
        out.send(&Int32 { data }).unwrap();
        core.lock().accept();
    }

    assert_eq!(all(&mut input), [8, 9, 10]);
    assert_eq!(core.lock().connections[0].statistics.take(0).lost, 0);
}

#[test]
fn what_is_no_message_is_counted_and_dropped() {
    let place = Place::new();
    let memory = Memory::open(&place.memory, "test").unwrap();
    let (core, mut input) = input::<Int32>(&memory, 3);
    let publisher = memory.publisher("s/c/value", 3, 64).unwrap();

    publisher.loan(2).unwrap().send(SampleHeader::new(&token(1, 1))).unwrap();
    let nameless = SampleHeader { minted_by: [255; 32], ..SampleHeader::new(&token(1, 1)) };
    publisher.loan(4).unwrap().send(nameless).unwrap();

    assert!(input.receive().is_none());
    assert_eq!(core.lock().connections[0].statistics.take(0).broken, 2);
}

#[test]
fn a_picture_goes_through_shared_memory_in_place() {
    let place = Place::new();
    let memory = Memory::open(&place.memory, "test").unwrap();
    let (shared, out) = output::<Image>(&memory);
    let (_, mut input) = input::<Image>(&memory, 3);
    shared.lock().set_token(Some(&token(1, 1)));
    shared.lock().set_tick(12);
    let shape = ImageView { width: 4, height: 2, encoding: "mono8", step: 4, ..Default::default() };

    out.fill(&shape, 8, |data| data.copy_from_slice(b"picture!")).unwrap();

    let sample = input.latest().unwrap();
    assert_eq!(sample.message().unwrap(), ImageView { data: b"picture!", ..shape });
    assert_eq!((sample.header().tick, sample.header().sequence), (12, 1));
    assert_eq!((sample.token(), sample.connection()), (Some(token(1, 1)), 4));
}
