//! A mesh that knows a few robots, and whatever a robot with the key may say to it: bounded
//! answers, bounded queues, bounded memory, and it goes on working.
#![no_main]

use std::time::Duration;

use libfuzzer_sys::fuzz_target;
use sdr_core::{
    mesh::{DATAGRAM_BYTES_MAX, FleetTable, Incarnation, Mesh, MeshConfig},
    time::Instant,
};
use sdr_fuzz::{bytes::Choices, fleet, meter};

/// Datagrams in answer to one: 12, copies of news for others, and the return greeting.
const ANSWERS_MAX: usize = 12 + 32 + 4 * 12;
/// What one datagram may add to the news.
const NEWS_MAX: usize = 300;
/// Memory that an input of a few datagrams may leave behind, and take on the way.
const MEMORY_MAX: usize = 16 << 20;
const STEPS_MAX: usize = 48;

fn new_mesh() -> Mesh {
    let config = MeshConfig {
        robot: fleet::robot(0),
        fleet: fleet::number(),
        seeds: (1..fleet::ROBOTS).map(fleet::address).collect(),
        group: None,
        listen: Some(fleet::address(0)),
        period: Duration::from_millis(350),
        gone_after: Duration::from_millis(11_500),
    };
    let own = Incarnation { counter: 3, nonce: 9 };
    Mesh::new(config, own, FleetTable::default(), &[], Instant::ZERO)
}

/// Takes everything out; the number of datagrams.
fn drain(mesh: &mut Mesh) -> usize {
    let mut sent = 0;
    while let Some((_, bytes)) = mesh.poll_send() {
        assert!(bytes.len() <= DATAGRAM_BYTES_MAX);
        sent += 1;
    }
    let news = std::iter::from_fn(|| mesh.poll_news()).count();
    assert!(news <= NEWS_MAX, "{news} news of one datagram");
    sent
}

/// A datagram as a robot of the fleet could seal it.
fn datagram(choices: &mut Choices<'_>) -> Vec<u8> {
    let robot = choices.byte();
    let counter = u64::from(choices.byte() % 5);
    let heartbeat = u64::from(choices.short()) * 8 + 1;
    let sequence = u64::from(choices.byte());
    let incarnation = Incarnation { counter, nonce: u32::from(robot) };
    let mut bytes = fleet::header(robot, incarnation, heartbeat, sequence);
    for _ in 0..=choices.byte() % 4 {
        let tag = choices.byte() % 20;
        fleet::put_section(tag, choices.slice(), &mut bytes);
    }
    bytes
}

fuzz_target!(|bytes: &[u8]| {
    let mut choices = Choices(bytes);
    let mut mesh = new_mesh();
    let mut now = Instant::from_millis(1);
    meter::at_most(MEMORY_MAX, || {
        for _ in 0..STEPS_MAX {
            if choices.is_empty() {
                break;
            }
            let step = choices.byte();
            let from = fleet::address(step >> 4);
            match step % 4 {
                0 => now = now + Duration::from_millis(u64::from(choices.byte()) * 40),
                1 => mesh.handle_datagram(now, from, choices.slice()),
                _ => mesh.handle_datagram(now, from, &datagram(&mut choices)),
            }
            let answers = drain(&mut mesh);
            assert!(answers <= ANSWERS_MAX, "{answers} datagrams in answer to one");
            mesh.handle_tick(now);
            drain(&mut mesh);
        }
        // what was learnt does not make it talk without end
        for _ in 0..20 {
            now = now + Duration::from_millis(700);
            mesh.handle_tick(now);
            let sent = drain(&mut mesh);
            assert!(sent <= 200, "{sent} datagrams in one tick");
        }
        assert!(mesh.next_deadline() > now, "a deadline that is never met");
    });
});
