//! Bad input is counted, and said at a bounded rate.

use std::collections::BTreeMap;
use std::sync::{Arc, Mutex, PoisonError};
use std::time::Duration;

use sdr_core::time::Instant;

use crate::clock;
use crate::events::Events;

/// Time between two events about the same kind of bad input.
const SAY_PERIOD: Duration = Duration::from_secs(10);

/// Kinds of bad input.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(crate) enum Kind {
    /// A datagram larger than any agent sends.
    DatagramOversized,
    /// A datagram that came while the loop was too busy to take it.
    DatagramUnread,
    /// A datagram that is none of the mesh's, as the brain found.
    DatagramMalformed,
    /// A datagram of another fleet, as the brain found.
    DatagramForeign,
    /// A datagram that brought nothing new, in a second in which most did.
    DatagramStale,
    /// A datagram without a seal, where the mesh has keys.
    DatagramUnsealed,
    /// A datagram sealed with a key that is not here.
    DatagramNoKey,
    /// A datagram sealed with a key that a rotation retired.
    DatagramRetiredKey,
    /// A datagram whose seal is broken.
    DatagramForged,
    /// A datagram that came before.
    DatagramReplayed,
    /// A datagram of a sender that did not prove to live: recorded in the past.
    DatagramUnproven,
    /// A statement that the fleet's authority did not sign.
    NoticeForged,
    /// A certificate that is not let in.
    CertificateRefused,
    /// A key that is none, or that its papers do not name.
    KeyRefused,
    /// A request that its operator's role does not allow.
    ApiForbidden,
    /// A line on the components' socket that is none of the protocol.
    ComponentLine,
    /// A greeting on the components' socket by somebody who was not started by this agent.
    ComponentHello,
    /// A sensor's port of another type than the sensor's.
    SensorType,
    /// A sample of a sensor's port that is no message of its type.
    SensorSample,
    /// A request body or address that the API does not know.
    ApiRequest,
}

impl Kind {
    /// The name of its counter.
    pub(crate) fn word(self) -> &'static str {
        match self {
            Self::DatagramOversized => "datagrams_oversized",
            Self::DatagramUnread => "datagrams_unread",
            Self::DatagramMalformed => "datagrams_malformed",
            Self::DatagramForeign => "datagrams_foreign",
            Self::DatagramStale => "datagrams_stale",
            Self::DatagramUnsealed => "datagrams_unsealed",
            Self::DatagramNoKey => "datagrams_no_key",
            Self::DatagramRetiredKey => "datagrams_retired_key",
            Self::DatagramForged => "datagrams_forged",
            Self::DatagramReplayed => "datagrams_replayed",
            Self::DatagramUnproven => "datagrams_unproven",
            Self::NoticeForged => "notices_forged",
            Self::CertificateRefused => "certificates_refused",
            Self::KeyRefused => "keys_refused",
            Self::ApiForbidden => "api_requests_forbidden",
            Self::ComponentLine => "component_lines_bad",
            Self::ComponentHello => "component_hellos_refused",
            Self::SensorType => "sensor_ports_mistyped",
            Self::SensorSample => "sensor_samples_bad",
            Self::ApiRequest => "api_requests_bad",
        }
    }
}

/// The counters; cheap to clone.
#[derive(Clone, Debug)]
pub(crate) struct Trouble {
    events: Events,
    counts: Arc<Mutex<BTreeMap<Kind, Count>>>,
}

#[derive(Clone, Copy, Debug, Default)]
struct Count {
    seen: u64,
    /// Of those that somebody else counts: how many when it was said last.
    said: u64,
    said_at: Option<Instant>,
}

impl Count {
    /// Whether it may be said again; if so, it is said now.
    fn is_due(&mut self, now: Instant) -> bool {
        let due = self.said_at.is_none_or(|at| now.since(at) >= SAY_PERIOD);
        if due {
            self.said_at = Some(now);
        }
        due
    }
}

impl Trouble {
    /// Counters that speak through `events`.
    pub(crate) fn new(events: Events) -> Self {
        Self { events, counts: Arc::default() }
    }

    /// Counts one; the first of a while is an event.
    pub(crate) fn count(&self, kind: Kind, what: &str) {
        let now = clock::now();
        let seen = {
            let mut counts = self.counts.lock().unwrap_or_else(PoisonError::into_inner);
            let count = counts.entry(kind).or_default();
            count.seen += 1;
            if !count.is_due(now) {
                return;
            }
            count.seen
        };
        self.publish(kind, what, seen);
    }

    /// As [`Trouble::count`] for what somebody else counts, and has counted `seen` of so far:
    /// growth is an event, now or when the while is over.
    pub(crate) fn note(&self, kind: Kind, seen: u64, what: &str) {
        let now = clock::now();
        {
            let mut counts = self.counts.lock().unwrap_or_else(PoisonError::into_inner);
            if seen == 0 && !counts.contains_key(&kind) {
                return;
            }
            let count = counts.entry(kind).or_default();
            count.seen = seen;
            if seen <= count.said || !count.is_due(now) {
                return;
            }
            count.said = seen;
        }
        self.publish(kind, what, seen);
    }

    /// Counts one and says it: for what its finder says only once.
    pub(crate) fn say(&self, kind: Kind, what: &str) {
        let seen = {
            let mut counts = self.counts.lock().unwrap_or_else(PoisonError::into_inner);
            let count = counts.entry(kind).or_default();
            count.seen += 1;
            count.seen
        };
        self.publish(kind, what, seen);
    }

    fn publish(&self, kind: Kind, what: &str, seen: u64) {
        #[expect(clippy::cast_precision_loss, reason = "counts stay far below 2^53")]
        let event = self.events.new_event("bad-input", what).number(kind.word(), seen as f64);
        self.events.publish(event);
    }

    /// All counters that are not zero.
    pub(crate) fn counters(&self) -> BTreeMap<String, u64> {
        let counts = self.counts.lock().unwrap_or_else(PoisonError::into_inner);
        counts.iter().map(|(kind, count)| (kind.word().to_string(), count.seen)).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use sdr_core::id::RobotId;

    #[test]
    fn a_flood_of_bad_input_is_counted_and_said_once() {
        let events = Events::new(RobotId::new("robot-1").unwrap());
        let trouble = Trouble::new(events.clone());

        for _ in 0..1000 {
            trouble.count(Kind::ComponentLine, "not JSON");
        }
        trouble.count(Kind::ApiRequest, "no such path");

        assert_eq!(trouble.counters()["component_lines_bad"], 1000);
        assert_eq!(events.since(0).len(), 2);
    }

    #[test]
    fn growth_that_was_kept_back_is_said_later() {
        let mut count = Count::default();
        let start = Instant::from_millis(1_000_000);

        assert!(count.is_due(start));
        assert!(!count.is_due(start + SAY_PERIOD / 2));
        assert!(count.is_due(start + SAY_PERIOD));
    }
}
