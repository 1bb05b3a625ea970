//! What a datagram brings.

use core::{net::SocketAddr, time::Duration};

use alloc::vec::Vec;

use super::{
    Beats, Datagram, Header, Mesh, MeshNews, Pulse, Section, Sign, Standing,
    author_table::{Admission, Lookup, Seat},
    liveness::Heard,
};
use crate::time::Instant;

/// A datagram may be overtaken by others that were sent so much later.
const REORDER_MAX: Duration = Duration::from_secs(2);
/// Beats of a robot whose last news is older than this are not understood: their bits may
/// have come round.
const BEAT_AGE_MAX: Duration = Duration::from_secs(128);
/// Robots told at once that this one hears again.
const RETURN_PEERS: usize = 32;
/// Addresses told to a robot that is new here.
const ADDRESSES_TOLD: usize = 16;
/// Addresses taken from one datagram.
const ADDRESSES_TAKEN: usize = 32;

impl Mesh {
    /// A datagram under this robot's own name: an echo, an old life, or a twin.
    pub(super) fn handle_own_name(&mut self, from: SocketAddr, header: &Header) {
        if header.incarnation == self.own {
            return self.meet_self(from);
        }
        self.counters.stale += 1;
        if header.incarnation > self.own {
            self.outgrow(header.incarnation);
            self.news.push_back(MeshNews::DuplicateId(from));
        }
    }

    pub(super) fn take_in(&mut self, from: SocketAddr, datagram: Datagram) {
        let header = datagram.header;
        let known = self.peers.seat_at(from).filter(|seat| {
            let author = self.authors.at(*seat);
            author.incarnation == header.incarnation && author.robot == header.from
        });
        let admission = known.map(Admission::Known);
        let admission = admission.unwrap_or_else(|| self.admit(&header.from, header.incarnation));
        let seat = match admission {
            Admission::Outdated(seat) => {
                self.counters.stale += 1;
                return self.correct(from, seat);
            }
            Admission::Full => return,
            Admission::New(seat) | Admission::Known(seat) => seat,
        };
        let is_new = !self.liveness.is_living(seat);
        let (known, fresh_at) =
            self.liveness.get(seat).map_or((0, self.clock), |seen| (seen.heartbeat, seen.fresh_at));
        let repeated = header.heartbeat <= known && self.clock.since(fresh_at) > REORDER_MAX;
        let reorder_ms = u64::try_from(REORDER_MAX.as_millis()).unwrap_or(u64::MAX);
        if repeated || header.heartbeat.saturating_add(reorder_ms) < known {
            self.counters.stale += 1;
        } else {
            self.hear(seat, header.heartbeat, self.said_at(Duration::ZERO));
            if self.liveness.is_living(seat) {
                self.hear_directly(seat, from, header.heartbeat >= known);
            }
            if header.sequence > self.authors.at(seat).sequence() {
                self.repair.want(seat, self.clock);
            }
        }
        let mut answer = Vec::new();
        for section in datagram.sections {
            self.take_section(seat, from, section, &mut answer);
        }
        if is_new && self.liveness.is_living(seat) {
            answer.extend(self.greeting(seat));
            let peers = self.pick(ADDRESSES_TOLD, &[]);
            answer.push(Section::Peers(peers));
        }
        if !answer.is_empty() {
            self.send(from, answer);
        }
    }

    fn take_section(
        &mut self,
        seat: Seat,
        from: SocketAddr,
        section: Section,
        answer: &mut Vec<Section>,
    ) {
        match section {
            Section::Link(mark) => self.links.take(seat, mark, self.clock),
            // the header and the link's mark are the answer; who is new wants to compare, too
            Section::Ping => answer.push(self.summary()),
            Section::Beats(beats) => {
                self.liveness.note_other_names(self.clock);
                self.take_beats(from, &beats);
            }
            Section::Summary(summary) => self.compare(from, summary, answer),
            Section::Pulse(pulse) => {
                self.compare(from, pulse.summary, answer);
                self.take_pulse(from, &pulse);
            }
            Section::Stamps(stamps) => stamps.into_iter().for_each(|stamp| self.take_stamp(stamp)),
            Section::AskStamps(ask) => self.answer_stamps(&ask, answer),
            Section::AskRecords(asks) => self.answer_records(&asks, answer),
            Section::AuthorDelta(delta) => self.learn(delta),
            Section::AskNews(ask) => self.answer_inquiry(&ask, answer),
            Section::News(news) => self.take_news(seat, news),
            Section::Roster(piece) => self.answer_roster(&piece, answer),
            Section::FleetNodes(nodes) => self.answer_nodes(&nodes, answer),
            Section::FleetEntries(piece) => self.answer_entries(&piece, answer),
            Section::FleetWanted(keys) => self.answer_wanted(&keys, answer),
            Section::FleetNews(records) => self.take_fleet_news(from, records, answer),
            Section::FleetRecords(records) => self.take_records(from, records, answer),
            Section::Peers(addresses) => {
                let some = addresses.into_iter().take(ADDRESSES_TAKEN);
                some.for_each(|address| self.peers.learn(address));
            }
        }
    }

    /// The robot itself spoke; this robot hears.
    fn hear_directly(&mut self, seat: Seat, from: SocketAddr, is_newest: bool) {
        if is_newest {
            self.peers.hear(seat, from);
        }
        let silence = self.liveness.hear_directly(seat, self.clock);
        if let Some(silence) = silence {
            self.liveness.forgive(silence, self.clock);
            self.links.forgive();
        }
        if self.liveness.rejoins() {
            self.news.push_back(MeshNews::Rejoined);
        }
        if silence.is_some() {
            // others may be close to their patience with this robot
            let peers = self.pick(RETURN_PEERS, &[]);
            for peer in peers {
                self.send(peer, Vec::new());
            }
        }
    }

    /// News of a robot by any path.
    pub(super) fn hear(&mut self, seat: Seat, heartbeat: u64, said_at: Instant) {
        if seat == Seat::OWN {
            return;
        }
        if self.liveness.hear(seat, heartbeat, said_at, self.clock) == Heard::Return {
            let robot = self.authors.at(seat).robot.clone();
            self.news.push_back(MeshNews::Alive(robot));
        }
    }

    fn take_beats(&mut self, from: SocketAddr, beats: &Beats) {
        let mut unknown = Vec::new();
        for beat in &beats.beats {
            let seat = match self.authors.lookup(beat.id, beats.wide) {
                Lookup::One(Seat::OWN) => continue,
                Lookup::One(seat) => seat,
                Lookup::Unknown | Lookup::Ambiguous => {
                    unknown.push(beat.id);
                    continue;
                }
            };
            if !self.take_sign(seat, &beat.sign) {
                unknown.push(beat.id);
            }
        }
        if !unknown.is_empty() {
            self.ask_stamps(from, beats.wide, unknown);
        }
    }

    /// Beats by place mean something only to who knows the same robots.
    fn take_pulse(&mut self, from: SocketAddr, pulse: &Pulse) {
        let readable = pulse.names == self.authors.names_hash();
        self.repair.note_names(readable);
        if !readable {
            self.liveness.note_other_names(self.clock);
            return;
        }
        let mut unknown = Vec::new();
        for beat in &pulse.beats {
            let seat = self.authors.at_place(usize::from(beat.place));
            let Some(seat) = seat.filter(|seat| *seat != Seat::OWN) else { continue };
            let same_life = beat.sign.odd == (self.authors.at(seat).incarnation.counter & 1 == 1);
            if !same_life || !self.take_sign(seat, &beat.sign) {
                unknown.push(seat);
            }
        }
        if !unknown.is_empty() {
            self.ask_names(from, &unknown);
        }
    }

    /// A sign of life from others; whether enough is known of the robot to read it.
    fn take_sign(&mut self, seat: Seat, sign: &Sign) -> bool {
        let Some(seen) = self.liveness.get(seat) else { return true };
        let forgotten =
            seen.standing == Standing::Unheard || self.clock.since(seen.fresh_at) > BEAT_AGE_MAX;
        if forgotten {
            return false;
        }
        if let Some(heartbeat) = sign.heartbeat_after(seen.heartbeat) {
            let said_at = self.said_at(sign.age());
            self.hear(seat, heartbeat, said_at);
        }
        if sign.is_ahead_of(self.authors.at(seat).sequence()) {
            self.repair.want(seat, self.clock);
        }
        true
    }

    /// Tells who became quiet or gone, and whether nobody is heard any more.
    pub(super) fn judge(&mut self) {
        for (seat, standing) in self.liveness.judge(self.clock) {
            let robot = self.authors.at(seat).robot.clone();
            match standing {
                Standing::Quiet => self.news.push_back(MeshNews::Quiet(robot)),
                Standing::Gone => {
                    self.peers.lose(seat, self.clock);
                    self.news.push_back(MeshNews::Gone(robot));
                }
                Standing::Alive | Standing::Unheard => {}
            }
        }
        if self.liveness.becomes_isolated(self.clock) {
            self.news.push_back(MeshNews::Isolated);
        }
    }
}
