//! Over real shared memory, in a place of their own.

use std::os::fd::AsFd;
use std::path::PathBuf;

use rustix::event::{PollFd, PollFlags, poll};
use sdr_core::{
    id::RobotId,
    order::{Epoch, Token},
};

use super::*;
use crate::testing::Place;

fn token() -> Token {
    Token { epoch: Epoch::first(&RobotId::new("robot-1").unwrap()), run: 1 }
}

fn send(publisher: &Publisher, sequence: u64, bytes: &[u8]) -> usize {
    let mut loan = publisher.loan(bytes.len()).unwrap();
    loan.payload_mut().copy_from_slice(bytes);
    loan.send(SampleHeader { sequence, ..SampleHeader::new(&token()) }).unwrap()
}

fn is_readable(subscriber: &Subscriber) -> bool {
    let fd = subscriber.as_fd();
    let limit = rustix::event::Timespec { tv_sec: 0, tv_nsec: 0 };
    poll(&mut [PollFd::new(&fd, PollFlags::IN)], Some(&limit)).unwrap() == 1
}

#[test]
fn what_is_sent_arrives_in_order_with_its_header_and_wakes_the_reader() {
    let place = Place::new();
    let memory = Memory::open(&place.memory, "test").unwrap();
    let subscriber = memory.subscriber("s/c/p", 8).unwrap();
    let publisher = memory.publisher("s/c/p", 8, 16).unwrap();
    subscriber.clear_wakes();
    assert!(!is_readable(&subscriber));

    assert_eq!(send(&publisher, 1, b"one"), 1);
    send(&publisher, 2, &vec![7; 100_000]);

    assert!(is_readable(&subscriber));
    subscriber.clear_wakes();
    assert!(!is_readable(&subscriber));
    let first = subscriber.receive().unwrap().unwrap();
    assert_eq!((first.payload(), first.header().sequence), (b"one".as_slice(), 1));
    assert_eq!(first.header().token(), Some(token()));
    assert_eq!(subscriber.receive().unwrap().unwrap().payload(), vec![7; 100_000]);
    assert!(subscriber.receive().unwrap().is_none());
}

#[test]
fn a_slow_reader_loses_its_oldest_samples() {
    let place = Place::new();
    let memory = Memory::open(&place.memory, "test").unwrap();
    let publisher = memory.publisher("s/c/p", 8, 16).unwrap();
    let subscriber = memory.subscriber("s/c/p", 2).unwrap();

    for sequence in 1..=5 {
        send(&publisher, sequence, b"x");
    }

    let mut seen = Vec::new();
    while let Some(sample) = subscriber.receive().unwrap() {
        seen.push(sample.header().sequence);
    }
    assert_eq!(seen, [4, 5]);
}

#[test]
fn a_full_queue_may_be_held_while_more_arrives() {
    let place = Place::new();
    let memory = Memory::open(&place.memory, "test").unwrap();
    let publisher = memory.publisher("s/c/p", 64, 16).unwrap();
    let subscriber = memory.subscriber("s/c/p", 64).unwrap();

    let mut held = Vec::new();
    for sequence in 0..68 {
        send(&publisher, sequence, b"x");
        held.push(subscriber.receive().unwrap().unwrap());
    }

    assert_eq!(held.len(), 68);
}

#[test]
fn those_who_open_a_port_with_other_depths_get_the_first_one_s_class() {
    let place = Place::new();
    let memory = Memory::open(&place.memory, "test").unwrap();
    let publisher = memory.publisher("s/c/p", 8, 16).unwrap();
    let subscriber = memory.subscriber("s/c/p", 64).unwrap();

    for sequence in 1..=20 {
        send(&publisher, sequence, b"x");
    }

    assert_eq!(subscriber.receive().unwrap().unwrap().header().sequence, 5);
}

#[test]
fn two_robots_on_one_machine_do_not_hear_each_other() {
    let (here, there) = (Place::new(), Place::new());
    let mine = Memory::open(&here.memory, "test").unwrap();
    let theirs = Memory::open(&there.memory, "test").unwrap();
    let subscriber = mine.subscriber("s/c/p", 2).unwrap();
    let publisher = theirs.publisher("s/c/p", 8, 16).unwrap();

    assert_eq!(send(&publisher, 1, b"x"), 0);
    assert!(subscriber.receive().unwrap().is_none());
}

#[test]
fn a_sample_over_the_bound_is_refused_with_the_number() {
    let place = Place::new();
    let memory = Memory::open(&place.memory, "test").unwrap();
    let publisher = memory.publisher("s/c/p", 8, 16).unwrap();

    let error = publisher.loan(PAYLOAD_BYTES_MAX + 1).unwrap_err().to_string();

    assert!(error.contains("67108865 bytes") && error.contains("67108864"), "{error}");
}

#[test]
fn a_place_that_cannot_work_is_refused_before_anything_is_made() {
    let root = PathBuf::from("/dev/shm/").join("x".repeat(60));
    let long = SharedMemory { prefix: String::from("a_"), root: root.clone() };
    assert!(matches!(Memory::open(&long, "t"), Err(ShmError::RootTooLong { .. })));
    assert!(!root.exists());
    let wide = SharedMemory { prefix: "p".repeat(13), root: PathBuf::from("/dev/shm/x") };
    assert!(matches!(Memory::open(&wide, "t"), Err(ShmError::PrefixTooLong { .. })));
}

#[test]
fn the_header_is_what_the_protocol_promises_to_other_languages() {
    let place = Place::new();
    let memory = Memory::open(&place.memory, "test").unwrap();
    let (samples, _) = memory.services("a/b/c", 8).unwrap();

    let types = samples.static_config().message_type_details();

    let header = types.user_header;
    assert_eq!(header.type_name().to_string(), "sdr.SampleHeader.v1");
    assert_eq!((header.size(), header.alignment()), (72, 8));
    assert_eq!((types.payload.type_name().to_string(), types.payload.size()), ("u8".into(), 1));
    let offsets = [
        std::mem::offset_of!(SampleHeader, epoch),
        std::mem::offset_of!(SampleHeader, minted_by),
        std::mem::offset_of!(SampleHeader, run),
        std::mem::offset_of!(SampleHeader, flags),
        std::mem::offset_of!(SampleHeader, sequence),
        std::mem::offset_of!(SampleHeader, tick),
        std::mem::offset_of!(SampleHeader, source_time_ns),
    ];
    assert_eq!(offsets, [0, 8, 40, 44, 48, 56, 64]);
}
