//! A fleet to pretend to be: names, addresses, datagrams that a robot with the key could send.

use std::net::SocketAddr;

use sdr_core::{id::RobotId, mesh::Incarnation, order::hash64};

/// Robots in it, `robot-0` being the one under test.
pub const ROBOTS: u8 = 6;
/// The fleet's name.
pub const NAME: &str = "moon";

/// The fleet's number on the wire.
pub fn number() -> u32 {
    u32::try_from(hash64(NAME.as_bytes()) & 0xffff_ffff).expect("masked")
}

/// The name of a robot.
pub fn robot(number: u8) -> RobotId {
    RobotId::new(&format!("robot-{}", number % ROBOTS)).expect("a name")
}

/// Where it is.
pub fn address(number: u8) -> SocketAddr {
    SocketAddr::from(([10, 0, 0, number % ROBOTS], 7600))
}

/// The start of a datagram; sections follow as they are.
pub fn header(number: u8, incarnation: Incarnation, heartbeat: u64, sequence: u64) -> Vec<u8> {
    let header = sdr_core::mesh::Header {
        fleet: self::number(),
        from: robot(number),
        incarnation,
        heartbeat,
        sequence,
    };
    header.pack(&[]).remove(0)
}

/// Appends a section: tag, length, body; the body is cut to what one datagram holds.
pub fn put_section(tag: u8, body: &[u8], datagram: &mut Vec<u8>) {
    let room = sdr_core::mesh::DATAGRAM_BYTES_MAX.saturating_sub(datagram.len() + 3);
    let body = &body[..body.len().min(room)];
    datagram.push(tag);
    let (low, high) = (body.len() & 0x7f, body.len() >> 7);
    let short = |value: usize| u8::try_from(value).expect("below 128");
    match high {
        0 => datagram.push(short(low)),
        _ => datagram.extend([short(low) | 0x80, short(high)]),
    }
    datagram.extend(body);
}
