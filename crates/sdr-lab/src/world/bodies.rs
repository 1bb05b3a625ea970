//! The thread that moves the rovers and serves their wheels.

use std::os::unix::net::UnixStream;
use std::sync::Arc;

use super::peer::{Device, wait_for};
use super::rover::Command;
use super::state::{Shared, monotonic_ns};
use crate::device::{WheelsAnswer, check_command, line_of};

/// Readings a second.
pub(super) const READINGS_HZ: u32 = 100;
/// One step of motion, nanoseconds: two steps a reading.
const STEP_NS: u64 = 5_000_000;
/// After a pause longer than this (a suspended machine) time goes on from now, nanoseconds.
const LATE_MAX_NS: u64 = 250_000_000;
/// A reader that has so much unread gets no more readings until it has caught up, bytes.
const UNREAD_BYTES_MAX: usize = 64 << 10;

/// Runs until `wake` closes; `wheels` has one device for each body, in the same order.
pub(super) fn run(shared: &Arc<Shared>, mut wheels: Vec<Device>, wake: &UnixStream) {
    let mut next_ns = monotonic_ns();
    let mut steps: u64 = 0;
    loop {
        let now_ns = monotonic_ns();
        if now_ns.saturating_sub(next_ns) > LATE_MAX_NS {
            next_ns = now_ns;
        }
        while next_ns <= now_ns {
            let seconds = STEP_NS as f64 / 1e9;
            shared.truth().advance(next_ns, shared.elapsed(), seconds);
            next_ns += STEP_NS;
            steps += 1;
            if steps.is_multiple_of(2) {
                tell(shared, &mut wheels, steps / 2);
            }
        }
        if wait_for(&mut wheels, wake, next_ns.saturating_sub(monotonic_ns())) {
            return;
        }
        for (index, device) in wheels.iter_mut().enumerate() {
            listen(shared, index, device);
        }
    }
}

/// Sends each client the readings of its wheels.
fn tell(shared: &Arc<Shared>, wheels: &mut [Device], sequence: u64) {
    for (index, device) in wheels.iter_mut().enumerate() {
        if device.peers.is_empty() {
            continue;
        }
        let mut reading = shared.truth().bodies[index].rover.reading();
        reading.sequence = sequence;
        let line = line_of(&WheelsAnswer::Reading(reading));
        for peer in &mut device.peers {
            if peer.waiting() < UNREAD_BYTES_MAX {
                peer.send(&line);
            }
        }
    }
}

/// Takes the commands that came.
fn listen(shared: &Arc<Shared>, index: usize, device: &mut Device) {
    for peer in &mut device.peers {
        for (number, line) in peer.receive() {
            match parse(&line) {
                Ok(command) => {
                    shared.truth().bodies[index].handle_command(monotonic_ns(), command);
                }
                Err(reason) => peer.refuse(&format!("line {number}: {reason}")),
            }
        }
    }
    device.peers.retain(|peer| !peer.is_gone());
}

fn parse(line: &[u8]) -> Result<Command, String> {
    let expected = r#"expected {"linear":<m/s>,"angular":<rad/s>}"#;
    let command: Command =
        serde_json::from_slice(line).map_err(|error| format!("{error}; {expected}"))?;
    check_command(&command).map_err(|error| error.to_string())?;
    Ok(command)
}
