//! What the brain's half of the mesh drops becomes bad input.

use sdr_core::mesh::MeshCounters;

use super::keys::FleetKeys;
use crate::trouble::{Kind, Trouble};

/// Fewer stale datagrams in a second are no flood: robots hear the same news from several
/// others.
const STALE_FLOOD_MIN: u64 = 50;

/// Turns what the mesh counts into bad input.
#[derive(Debug)]
pub(crate) struct MeshWatch {
    trouble: Trouble,
    /// `None` when datagrams are plain.
    keys: Option<FleetKeys>,
    before: MeshCounters,
    /// Stale datagrams of all seconds that were floods.
    flooded: u64,
}

impl MeshWatch {
    /// Speaks through `trouble`.
    pub(crate) fn new(trouble: Trouble, keys: Option<FleetKeys>) -> Self {
        Self { trouble, keys, before: MeshCounters::default(), flooded: 0 }
    }

    /// Looks at the counters; to be called once a second.
    pub(crate) fn look(&mut self, now: MeshCounters) {
        let said =
            format!("{} datagrams were none of the mesh's, {} were", now.malformed, now.received);
        self.trouble.note(Kind::DatagramMalformed, now.malformed, &said);
        let said = format!(
            "{} datagrams were of another fleet, {} of this one",
            now.foreign, now.received
        );
        self.trouble.note(Kind::DatagramForeign, now.foreign, &said);

        let stale = now.stale.saturating_sub(self.before.stale);
        let received = now.received.saturating_sub(self.before.received);
        if stale >= STALE_FLOOD_MIN && stale > received / 2 {
            self.flooded = self.flooded.saturating_add(stale);
        }
        let said = format!("{stale} of the last {received} datagrams were repeated or played back");
        self.trouble.note(Kind::DatagramStale, self.flooded, &said);
        self.before = now;

        if let Some(keys) = &self.keys {
            let unanswered = keys.counters().unanswered;
            let said = format!(
                "{} datagrams of {} senders that did not prove to live: recorded in the past, or gone",
                unanswered.datagrams, unanswered.starts
            );
            self.trouble.note(Kind::DatagramUnproven, unanswered.datagrams, &said);
        }
    }
}

#[cfg(test)]
mod tests {
    use sdr_core::id::RobotId;

    use super::*;
    use crate::events::Events;

    #[test]
    fn what_the_mesh_drops_is_said_with_its_counts_and_its_usual_repeats_are_not() {
        let events = Events::new(RobotId::new("robot-1").unwrap());
        let trouble = Trouble::new(events.clone());
        let mut watch = MeshWatch::new(trouble.clone(), None);
        let quiet = MeshCounters { received: 200, stale: 90, ..MeshCounters::default() };
        watch.look(quiet);
        assert!(trouble.counters().is_empty());
        assert_eq!(events.since(0), []);

        let bad = MeshCounters { received: 300, malformed: 7, foreign: 2, stale: 190, ..quiet };
        watch.look(bad);
        watch.look(MeshCounters { received: 301, malformed: 8, ..bad });

        let said = events.since(0);
        let reasons: Vec<_> = said.iter().map(|view| view.event.reason.as_str()).collect();
        assert_eq!(
            reasons,
            [
                "7 datagrams were none of the mesh's, 300 were",
                "2 datagrams were of another fleet, 300 of this one",
                "100 of the last 100 datagrams were repeated or played back",
            ]
        );
        assert_eq!(said[0].event.numbers["datagrams_malformed"], 7.0);
        assert_eq!(trouble.counters()["datagrams_malformed"], 8);
        assert_eq!(trouble.counters()["datagrams_stale"], 100);
    }
}
