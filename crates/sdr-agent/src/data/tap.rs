//! Chosen ports of this robot, for the recording and the figures of its body.

use std::os::fd::{AsFd, BorrowedFd};

use sdr_component::shm::{Memory, Subscriber};

use super::complaint::Complaint;

/// Samples that a tap may fall behind.
const DEPTH: u8 = 16;
/// Most samples taken before others get their turn.
const TURN_MAX: usize = 64;

/// One sample of a tapped port, whether made here or put in by the bridge.
#[derive(Debug)]
pub(crate) struct TapSample<'a> {
    /// `system.component.port`, as asked for.
    pub(crate) port: &'a str,
    /// CDR without an encapsulation header, little endian.
    pub(crate) body: &'a [u8],
}

/// Where tapped samples go; must not wait.
pub(crate) type TapSink = Box<dyn FnMut(TapSample<'_>) + Send>;

/// One tapped port.
pub(super) struct Tap {
    port: String,
    source: Option<Subscriber>,
    complaint: Complaint,
}

impl Tap {
    pub(super) fn new(port: &str) -> Self {
        Self { port: port.to_owned(), source: None, complaint: Complaint::default() }
    }

    /// Opens it unless it is open; what fails is tried again at the next call.
    pub(super) fn open(&mut self, memory: &Memory) {
        if self.source.is_none() {
            match memory.subscriber(&self.port.replace('.', "/"), DEPTH) {
                Ok(source) => self.source = Some(source),
                Err(error) => self.complaint.say("tap-closed", &self.port, &error),
            }
        }
    }

    /// Hands on what waits.
    pub(super) fn carry(&mut self, sink: &mut TapSink) {
        let Some(source) = &self.source else { return };
        source.clear_wakes();
        for _ in 0..TURN_MAX {
            match source.receive() {
                Ok(Some(sample)) => {
                    sink(TapSample { port: &self.port, body: sample.payload() });
                }
                Ok(None) => return,
                Err(error) => return self.complaint.say("tap-unread", &self.port, &error),
            }
        }
    }

    pub(super) fn wake_fd(&self) -> Option<BorrowedFd<'_>> {
        self.source.as_ref().map(AsFd::as_fd)
    }
}
