//! The thread that draws pictures for whoever asks.

use std::os::unix::net::UnixStream;
use std::sync::Arc;

use super::camera::{Camera, Scene};
use super::peer::{Device, wait_for};
use super::state::{Shared, monotonic_ns};
use crate::device::{CameraAnswer, CameraRequest, FrameHeader, line_of};
use crate::noise::Noise;

/// Clients that ask within this time get the same picture, nanoseconds.
const SHARE_NS: u64 = 15_000_000;
/// How long to wait when nothing happens, nanoseconds.
const IDLE_NS: u64 = 60_000_000_000;

/// One camera on one body.
#[derive(Debug)]
pub(super) struct Eye {
    camera: Arc<Camera>,
    body: usize,
    sequence: u64,
    stamp_ns: u64,
    noise: Noise,
    /// Header and bytes of the newest picture.
    message: Vec<u8>,
}

impl Eye {
    pub(super) fn new(camera: Arc<Camera>, body: usize, noise: Noise) -> Self {
        Self { camera, body, sequence: 0, stamp_ns: 0, noise, message: Vec::new() }
    }

    /// The message that answers a request now.
    fn look(&mut self, shared: &Arc<Shared>) -> &[u8] {
        let now_ns = monotonic_ns();
        if self.message.is_empty() || now_ns.saturating_sub(self.stamp_ns) > SHARE_NS {
            let scene = {
                let truth = shared.truth();
                let pose = truth.bodies[self.body].rover.pose;
                Scene { pose, object: truth.object, light: 1.0, seed: self.noise.bits() }
            };
            self.sequence += 1;
            self.stamp_ns = now_ns;
            let picture = self.camera.render(&scene);
            let header = FrameHeader {
                sequence: self.sequence,
                stamp_ns: now_ns,
                width: picture.width,
                height: picture.height,
                bytes: picture.rgb.len(),
            };
            self.message = line_of(&CameraAnswer::Frame(header));
            self.message.extend(picture.rgb);
        }
        &self.message
    }
}

/// Runs until `wake` closes; `eyes` and `devices` belong together, one by one.
pub(super) fn run(
    shared: &Arc<Shared>,
    mut eyes: Vec<Eye>,
    mut devices: Vec<Device>,
    wake: &UnixStream,
) {
    while !wait_for(&mut devices, wake, IDLE_NS) {
        for (eye, device) in eyes.iter_mut().zip(&mut devices) {
            for peer in &mut device.peers {
                for (number, line) in peer.receive() {
                    match serde_json::from_slice::<CameraRequest>(&line) {
                        Ok(CameraRequest::Get(_)) => peer.send(eye.look(shared)),
                        Err(error) => peer.refuse(&format!(
                            r#"line {number}: {error}; expected {{"get":"frame"}}"#
                        )),
                    }
                }
            }
            device.peers.retain(|peer| !peer.is_gone());
        }
    }
}
