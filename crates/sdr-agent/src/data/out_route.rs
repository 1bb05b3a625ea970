//! One local output on its way to other robots.

use std::{
    os::fd::{AsFd, BorrowedFd},
    sync::Arc,
    time::{Duration, Instant},
};

use sdr_component::shm::{Memory, Sample, SampleHeader, Subscriber};
use sdr_core::{order::Token, spec::Reliability};

use super::{
    complaint::Complaint,
    counters::Counts,
    origin::{Origin, RobotHash},
    transport::{EndpointId, SendError, Topic, Transport, TransportError, Way},
};

/// Largest body that crosses robots.
pub(super) const BODY_BYTES_MAX: usize = 1 << 20;
/// Most bytes that one reliable port sends in a second; the writer keeps them for six.
pub(super) const RELIABLE_BYTES_PER_SECOND: usize = 10_000_000;
/// Most samples carried before others get their turn.
const TURN_MAX: usize = 64;

/// Whether something was left for the next turn.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Left {
    Nothing,
    Samples,
}

/// Forwards what the active instance of this robot sends.
pub(super) struct OutRoute {
    pub(super) topic: Topic,
    active: Option<Active>,
    source: Option<Subscriber>,
    endpoint: Option<EndpointId>,
    counts: Arc<Counts>,
    allowance: Allowance,
    complaint: Complaint,
}

/// The token that may pass.
struct Active {
    header: SampleHeader,
    minter: RobotHash,
}

impl OutRoute {
    pub(super) fn new(topic: Topic, counts: Arc<Counts>) -> Self {
        Self {
            topic,
            active: None,
            source: None,
            endpoint: None,
            counts,
            allowance: Allowance::new(Instant::now()),
            complaint: Complaint::default(),
        }
    }

    /// From now on only samples with this token pass, or none.
    pub(super) fn set_active(&mut self, token: Option<&Token>) {
        self.active = token.map(|token| Active {
            header: SampleHeader::new(token),
            minter: RobotHash::of(&token.epoch.minted_by),
        });
    }

    /// Opens what is not open yet; what fails is tried again at the next call.
    pub(super) fn open(&mut self, memory: &Memory, transport: Option<&mut (dyn Transport + '_)>) {
        if self.source.is_none() {
            match memory.subscriber(&self.topic.path, self.topic.qos.depth) {
                Ok(source) => self.source = Some(source),
                Err(error) => self.complaint.say("route-closed", &self.topic.path, &error),
            }
        }
        if let (None, Some(transport)) = (self.endpoint, transport) {
            let opened: Result<_, TransportError> = transport.open(Way::Out, &self.topic);
            match opened {
                Ok(endpoint) => self.endpoint = Some(endpoint),
                Err(error) => self.complaint.say("route-closed", &self.topic.path, &error),
            }
        }
    }

    pub(super) fn close(&mut self, transport: Option<&mut (dyn Transport + '_)>) {
        if let (Some(endpoint), Some(transport)) = (self.endpoint.take(), transport) {
            transport.close(endpoint);
        }
    }

    /// Carries what waits in shared memory, for one turn.
    pub(super) fn carry(&mut self, transport: &mut dyn Transport) -> Left {
        let Some(source) = self.source.take() else { return Left::Nothing };
        source.clear_wakes();
        let mut left = Left::Samples;
        for _ in 0..TURN_MAX {
            match source.receive() {
                Ok(Some(sample)) => self.forward(&sample, transport),
                Ok(None) => {
                    left = Left::Nothing;
                    break;
                }
                Err(error) => {
                    self.counts.dropped_memory.add(1);
                    self.complaint.say("route-unread", &self.topic.path, &error);
                    left = Left::Nothing;
                    break;
                }
            }
        }
        self.source = Some(source);
        left
    }

    pub(super) fn is_endpoint(&self, endpoint: EndpointId) -> bool {
        self.endpoint == Some(endpoint)
    }

    pub(super) fn counts(&self) -> &Counts {
        &self.counts
    }

    /// Readable when the producer sent something.
    pub(super) fn wake_fd(&self) -> Option<BorrowedFd<'_>> {
        self.source.as_ref().map(AsFd::as_fd)
    }

    fn forward(&mut self, sample: &Sample, transport: &mut dyn Transport) {
        let (header, body) = (sample.header(), sample.payload());
        if header.is_injected() {
            return self.counts.refused_injected.add(1);
        }
        let Some(active) = self.active.as_ref().filter(|active| active.header.same_token(header))
        else {
            return self.counts.refused_token.add(1);
        };
        if body.len() > BODY_BYTES_MAX {
            self.counts.dropped_large.add(1);
            let reason = format!("{} bytes; at most {BODY_BYTES_MAX} cross robots", body.len());
            return self.complaint.say("sample-large", &self.topic.path, &reason);
        }
        if self.topic.qos.reliability == Reliability::Reliable
            && !self.allowance.admits(body.len(), Instant::now())
        {
            self.counts.dropped_rate.add(1);
            let reason = format!("over {RELIABLE_BYTES_PER_SECOND} bytes a second, reliable");
            return self.complaint.say("route-rate", &self.topic.path, &reason);
        }
        let Some(endpoint) = self.endpoint else { return self.counts.dropped_unsent.add(1) };
        let origin = Origin {
            epoch: header.epoch,
            minter: active.minter,
            run: header.run,
            sequence: header.sequence,
            tick: header.tick,
            source_time_ns: header.source_time_ns,
        };
        match transport.send(endpoint, &origin, body) {
            Ok(()) => {
                self.counts.forwarded_bytes.add(body.len() as u64);
                self.counts.forwarded.add(1);
            }
            Err(error @ (SendError::Backlog | SendError::Broken(_))) => {
                self.counts.dropped_unsent.add(1);
                self.complaint.say("sample-unsent", &self.topic.path, &error);
            }
        }
    }
}

/// Bytes that may still be sent: a second's worth, refilled steadily.
struct Allowance {
    bytes: usize,
    counted_at: Instant,
}

impl Allowance {
    fn new(now: Instant) -> Self {
        Self { bytes: RELIABLE_BYTES_PER_SECOND, counted_at: now }
    }

    fn admits(&mut self, bytes: usize, now: Instant) -> bool {
        let passed = now.duration_since(self.counted_at).min(Duration::from_secs(1));
        let earned = RELIABLE_BYTES_PER_SECOND as u64 * u64::from(passed.subsec_micros())
            / 1_000_000
            + RELIABLE_BYTES_PER_SECOND as u64 * passed.as_secs();
        self.bytes = self
            .bytes
            .saturating_add(usize::try_from(earned).unwrap_or(usize::MAX))
            .min(RELIABLE_BYTES_PER_SECOND);
        self.counted_at = now;
        let admitted = bytes <= self.bytes;
        if admitted {
            self.bytes -= bytes;
        }
        admitted
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_second_carries_its_worth_and_no_more() {
        let start = Instant::now();
        let mut allowance = Allowance::new(start);
        let megabyte = 1_000_000;

        assert!((0..10).all(|_| allowance.admits(megabyte, start)));
        assert!(!allowance.admits(megabyte, start));
        assert!(!allowance.admits(megabyte, start + Duration::from_millis(50)));
        assert!(allowance.admits(megabyte, start + Duration::from_millis(100)));
        assert!(!allowance.admits(megabyte, start + Duration::from_millis(100)));

        let later = start + Duration::from_secs(100);
        assert!((0..10).all(|_| allowance.admits(megabyte, later)));
        assert!(!allowance.admits(1, later));
    }
}
