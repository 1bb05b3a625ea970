//! Who is joined to our DDS endpoints, from the participant's stream of events.

use std::collections::{BTreeMap, BTreeSet};

use rustdds::{DomainParticipantStatusEvent, GUID};

use crate::data::transport::{EndpointId, Matched};

/// The remote endpoints of each of ours.
pub(super) struct Matching {
    participant: GUID,
    ours: BTreeMap<GUID, EndpointId>,
    remote: BTreeMap<EndpointId, BTreeSet<GUID>>,
    /// Ours that are joined to each other; such joints are never counted.
    echoes: BTreeSet<(EndpointId, GUID)>,
    changed: BTreeSet<EndpointId>,
}

impl Matching {
    pub(super) fn new(participant: GUID) -> Self {
        Self {
            participant,
            ours: BTreeMap::new(),
            remote: BTreeMap::new(),
            echoes: BTreeSet::new(),
            changed: BTreeSet::new(),
        }
    }

    /// Counts matches of `guid` for `endpoint` from now on.
    pub(super) fn add(&mut self, guid: GUID, endpoint: EndpointId) {
        self.ours.insert(guid, endpoint);
        self.remote.entry(endpoint).or_default();
    }

    /// Forgets one of our DDS entities and whom it was joined to.
    pub(super) fn remove(&mut self, guid: GUID) {
        if let Some(endpoint) = self.ours.remove(&guid) {
            self.remote.remove(&endpoint);
            self.changed.remove(&endpoint);
            self.echoes.retain(|(ours, _)| *ours != endpoint);
        }
    }

    /// Whom to write to one by one, because a reader of our own is joined to this writer too.
    ///
    /// That is so while a component moves: both robots have the reader and the writer. RustDDS
    /// finds no route to itself and would send every fragment to the multicast group, on every
    /// interface, to every robot.
    pub(super) fn one_by_one(&self, endpoint: EndpointId) -> Option<&BTreeSet<GUID>> {
        let echoes = self.echoes.iter().any(|(ours, _)| *ours == endpoint);
        echoes.then(|| self.remote.get(&endpoint))?
    }

    /// Takes in one event; built-in endpoints are nobody's and fall through.
    pub(super) fn handle(&mut self, event: &DomainParticipantStatusEvent) {
        // The enum is open-ended and mostly about other things.
        if let DomainParticipantStatusEvent::RemoteReaderMatched { local_writer, remote_reader } =
            event
        {
            self.join(*local_writer, *remote_reader);
        } else if let DomainParticipantStatusEvent::RemoteWriterMatched {
            local_reader,
            remote_writer,
        } = event
        {
            self.join(*local_reader, *remote_writer);
        } else if let DomainParticipantStatusEvent::ReaderLost { guid, .. }
        | DomainParticipantStatusEvent::WriterLost { guid, .. } = event
        {
            self.part(|remote| remote == guid);
        } else if let DomainParticipantStatusEvent::ParticipantLost { id, .. } = event {
            self.part(|remote| remote.prefix == *id);
        }
    }

    /// The next endpoint whose count changed.
    pub(super) fn poll(&mut self) -> Option<Matched> {
        let endpoint = self.changed.pop_first()?;
        let count = self.remote.get(&endpoint).map_or(0, BTreeSet::len);
        Some(Matched { endpoint, count: u16::try_from(count).unwrap_or(u16::MAX) })
    }

    fn join(&mut self, ours: GUID, remote: GUID) {
        let Some(endpoint) = self.ours.get(&ours) else { return };
        if remote.prefix == self.participant.prefix {
            self.echoes.insert((*endpoint, remote));
        } else if self.remote.entry(*endpoint).or_default().insert(remote) {
            self.changed.insert(*endpoint);
        }
    }

    fn part(&mut self, gone: impl Fn(&GUID) -> bool) {
        self.echoes.retain(|(_, theirs)| !gone(theirs));
        for (endpoint, remote) in &mut self.remote {
            let before = remote.len();
            remote.retain(|guid| !gone(guid));
            if remote.len() != before {
                self.changed.insert(*endpoint);
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use rustdds::LostReason;

    use super::*;

    fn guid(participant: u8, entity: u8) -> GUID {
        let mut bytes = [participant; 16];
        bytes[12..16].copy_from_slice(&[0, 0, entity, 3]);
        GUID::from_bytes(bytes)
    }

    fn matched(local: GUID, remote: GUID) -> DomainParticipantStatusEvent {
        DomainParticipantStatusEvent::RemoteReaderMatched {
            local_writer: local,
            remote_reader: remote,
        }
    }

    #[test]
    fn only_foreign_endpoints_of_open_routes_count_and_each_once() {
        let mut matching = Matching::new(guid(1, 0));
        matching.add(guid(1, 9), 5);

        for remote in [guid(2, 1), guid(2, 1), guid(1, 8)] {
            matching.handle(&matched(guid(1, 9), remote));
        }
        matching.handle(&matched(guid(1, 77), guid(2, 1)));

        assert_eq!(matching.poll(), Some(Matched { endpoint: 5, count: 1 }));
        assert_eq!(matching.poll(), None);
    }

    #[test]
    fn a_writer_joined_to_our_own_reader_has_its_readers_named() {
        let mut matching = Matching::new(guid(1, 0));
        matching.add(guid(1, 9), 5);
        matching.handle(&matched(guid(1, 9), guid(2, 1)));
        assert_eq!(matching.one_by_one(5), None);

        matching.handle(&matched(guid(1, 9), guid(1, 8)));
        assert_eq!(matching.one_by_one(5), Some(&BTreeSet::from([guid(2, 1)])));

        matching.handle(&DomainParticipantStatusEvent::ReaderLost {
            guid: guid(1, 8),
            reason: LostReason::Disposed,
        });
        assert_eq!(matching.one_by_one(5), None);
    }

    #[test]
    fn a_lost_participant_takes_all_its_endpoints_with_it() {
        let mut matching = Matching::new(guid(1, 0));
        matching.add(guid(1, 9), 5);
        for remote in [guid(2, 1), guid(2, 2), guid(3, 1)] {
            matching.handle(&matched(guid(1, 9), remote));
        }
        assert_eq!(matching.poll(), Some(Matched { endpoint: 5, count: 3 }));

        matching.handle(&DomainParticipantStatusEvent::ParticipantLost {
            id: guid(2, 0).prefix,
            reason: LostReason::Disposed,
        });

        assert_eq!(matching.poll(), Some(Matched { endpoint: 5, count: 1 }));
        matching.remove(guid(1, 9));
        assert_eq!(matching.poll(), None);
    }
}
