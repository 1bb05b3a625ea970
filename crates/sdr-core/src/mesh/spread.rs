//! News at once: own reports and shared facts go out when they change, with repeats.

use alloc::{collections::BTreeMap, vec, vec::Vec};
use core::{net::SocketAddr, time::Duration};

use super::{
    AuthorDelta, FleetRecord, Merge, Mesh, MeshNews, Section,
    author_table::Seat,
    wire::{SECTION_BYTES_MAX, TAG_FLEET_NEWS, body_of},
};
use crate::{
    id::RobotId,
    planted::{self, Defect},
    record::{FleetKey, FleetValue},
    time::Instant,
};

/// When a fresh shared fact is sent on, and to how many robots each time.
const WAVES: [(Duration, usize); 3] =
    [(Duration::ZERO, 4), (Duration::from_millis(250), 2), (Duration::from_millis(600), 2)];
/// Facts that wait for a wave; more are left to repair.
const WAITING_MAX: usize = 16_384;
/// Robots that a push of own reports reaches directly.
const PUSH_PEERS: usize = 8;
/// How often a fresh report rides on a round.
const RIDES: u8 = 2;
/// Bytes of reports that ride on one datagram.
const RIDE_BYTES: usize = 400;
/// Authors with reports that ride; more are left to repair.
const RIDING_MAX: usize = 256;
/// Reports that may wait do so for this long per robot of the fleet.
const REPORT_PERIOD_EACH: Duration = Duration::from_millis(500);
/// And at least so long.
const REPORT_PERIOD_MIN: Duration = Duration::from_secs(1);
/// Bytes that such a turn may take, shared by the fleet, and the least.
const REPORT_BYTES: usize = 8000;
const REPORT_BYTES_MIN: usize = 80;

#[derive(Clone, Copy, Debug)]
struct Ride {
    since: u64,
    left: u8,
}

#[derive(Clone, Debug)]
struct Wave {
    keys: Vec<FleetKey>,
    to: Vec<SocketAddr>,
    count: usize,
}

/// What is under way.
#[derive(Clone, Debug, Default)]
pub(super) struct Spread {
    /// Own records up to this one were pushed.
    pushed: u64,
    released_at: Option<Instant>,
    rides: BTreeMap<Seat, Ride>,
    waves: BTreeMap<(Instant, u64), Wave>,
    waiting: usize,
    number: u64,
}

impl Spread {
    /// Own records have new numbers.
    pub(super) fn say_anew(&mut self) {
        self.pushed = 0;
        self.rides.insert(Seat::OWN, Ride { since: 0, left: RIDES });
    }

    pub(super) fn next_deadline(&self) -> Option<Instant> {
        self.waves.keys().next().map(|(at, _)| *at)
    }

    fn ride(&mut self, seat: Seat, since: u64) {
        let full = self.rides.len() >= RIDING_MAX;
        match self.rides.get_mut(&seat) {
            Some(ride) => *ride = Ride { since: ride.since.min(since), left: RIDES },
            None if full => {}
            None => {
                self.rides.insert(seat, Ride { since, left: RIDES });
            }
        }
    }

    fn wait(&mut self, at: Instant, wave: Wave) {
        if self.waiting + wave.keys.len() <= WAITING_MAX {
            self.waiting += wave.keys.len();
            self.number += 1;
            self.waves.insert((at, self.number), wave);
        }
    }

    fn next_wave(&mut self, now: Instant) -> Option<Wave> {
        let first = self.waves.first_entry().filter(|entry| entry.key().0 <= now)?;
        let wave = first.remove();
        self.waiting -= wave.keys.len();
        Some(wave)
    }
}

impl Mesh {
    /// Time between two turns of reports that may wait, and the bytes of a turn: all robots'
    /// together stay the same however many they are.
    pub(super) fn report_turn(&self) -> (Duration, usize) {
        let robots = self.liveness.living_count() + 1;
        let each = REPORT_PERIOD_EACH * u32::try_from(robots).unwrap_or(u32::MAX);
        (each.max(REPORT_PERIOD_MIN), (REPORT_BYTES / robots).max(REPORT_BYTES_MIN))
    }

    /// Lets others hear of reports that waited for their turn.
    pub(super) fn release_staged(&mut self) {
        let (period, bytes) = self.report_turn();
        let due = self.spread.released_at.is_none_or(|at| self.clock.since(at) >= period);
        if due && self.authors.has_staged() {
            self.spread.released_at = Some(self.clock);
            let since = self.authors.at(Seat::OWN).sequence();
            self.authors.release(bytes);
            self.spread.ride(Seat::OWN, since);
        }
    }

    /// Own records made since the last push, to many at once.
    pub(super) fn push_own(&mut self) {
        let mut peers = self.pick(PUSH_PEERS, &[]);
        // whoever decides hears it first
        let deciding: Vec<SocketAddr> =
            self.preferred().into_iter().filter_map(|seat| self.peers.address(seat)).collect();
        peers.retain(|peer| !deciding.contains(peer));
        peers.truncate(PUSH_PEERS.saturating_sub(deciding.len()));
        peers.extend(deciding);
        self.spread.ride(Seat::OWN, self.spread.pushed);
        while self.spread.pushed < self.authors.at(Seat::OWN).sequence() {
            let own = self.authors.at(Seat::OWN);
            let Some(delta) = own.delta(self.spread.pushed, SECTION_BYTES_MAX) else { break };
            self.spread.pushed = delta.sequence;
            let section = [Section::AuthorDelta(delta).encode()];
            for peer in &peers {
                self.send_encoded(*peer, &section);
            }
        }
    }

    /// Fresh reports for the next datagram of a round.
    pub(super) fn next_deltas(&mut self) -> Vec<Section> {
        let mut deltas = Vec::new();
        let mut room = RIDE_BYTES;
        let seats: Vec<Seat> = self.spread.rides.keys().copied().collect();
        for seat in seats {
            let Some(ride) = self.spread.rides.get_mut(&seat) else { continue };
            let delta = self.authors.at(seat).delta(ride.since, room);
            let size = delta.as_ref().map_or(0, delta_len);
            ride.left = ride.left.saturating_sub(u8::from(delta.is_some() || room == RIDE_BYTES));
            if ride.left == 0 {
                self.spread.rides.remove(&seat);
            }
            room = room.saturating_sub(size);
            deltas.extend(delta.map(Section::AuthorDelta));
        }
        deltas
    }

    pub(super) fn learn(&mut self, delta: AuthorDelta) {
        if delta.robot == self.config.robot {
            return;
        }
        let admission = self.admit(&delta.robot, delta.incarnation);
        let Some(seat) = admission.seat() else { return };
        let before = self.authors.at(seat).sequence();
        if before > 0 && planted::is(Defect::StaleReports) {
            return;
        }
        let robot = delta.robot.clone();
        let learned = self.authors.learn(seat, delta);
        let advanced = self.authors.at(seat).sequence() > before;
        self.counters.refused += learned.refused;
        if learned.gap {
            self.repair.want(seat, self.clock);
        }
        if advanced {
            // what had to be asked for is no news to others
            if !self.repair.unwant(seat) {
                self.spread.ride(seat, before);
            }
        }
        if learned.records {
            self.news.push_back(MeshNews::Report(robot, learned.spoken));
        }
    }

    /// Own news of the fleet table: to whom it concerns, then in waves to all.
    pub(super) fn spread_own(&mut self, records: Vec<FleetRecord>) {
        if records.is_empty() {
            return;
        }
        let mut concerned: BTreeMap<SocketAddr, Vec<FleetKey>> = BTreeMap::new();
        for record in &records {
            for robot in self.concerned(&record.key) {
                let address = self.authors.seat(&robot).and_then(|seat| self.peers.address(seat));
                if let Some(address) = address {
                    concerned.entry(address).or_default().push(record.key.clone());
                }
            }
        }
        for (address, keys) in concerned {
            for (delay, _) in WAVES {
                let wave = Wave { keys: keys.clone(), to: vec![address], count: 0 };
                self.spread.wait(self.clock + delay, wave);
            }
        }
        let keys = records.into_iter().map(|record| record.key).collect();
        self.spread_keys(keys, Vec::new());
        self.spread_due();
    }

    /// News of the fleet table: taken, sent on when it is news here, answered when it is old.
    pub(super) fn take_fleet_news(
        &mut self,
        from: SocketAddr,
        records: Vec<FleetRecord>,
        answer: &mut Vec<Section>,
    ) {
        let fresh = self.merge(records, answer);
        self.spread_keys(fresh, vec![from]);
        self.spread_due();
    }

    /// Keys of those that are news; newer ones are the answer to those that are old.
    pub(super) fn merge(
        &mut self,
        records: Vec<FleetRecord>,
        answer: &mut Vec<Section>,
    ) -> Vec<FleetKey> {
        let (mut fresh, mut newer) = (Vec::new(), Vec::new());
        for record in records {
            let key = record.key.clone();
            match self.fleet.merge(record) {
                Merge::News => {
                    self.news.push_back(MeshNews::Record(key.clone()));
                    fresh.push(key);
                }
                // also the tombstone that a part of a system is too old for: without it the
                // other would offer its parts for ever
                Merge::Older => newer.extend(self.fleet.newer_than(&key).cloned()),
                Merge::Known if planted::is(Defect::EndlessEcho) => fresh.push(key),
                Merge::Known => {}
                Merge::Refused => self.counters.refused += 1,
            }
        }
        if !fresh.is_empty() {
            self.repair.note_change(self.clock);
        }
        answer.extend(sections_of(&newer, Section::FleetRecords));
        fresh
    }

    /// Sends facts on in waves, not to `without`.
    pub(super) fn spread_keys(&mut self, keys: Vec<FleetKey>, without: Vec<SocketAddr>) {
        if keys.is_empty() {
            return;
        }
        for (delay, count) in WAVES {
            let wave = Wave { keys: keys.clone(), to: without.clone(), count };
            self.spread.wait(self.clock + delay, wave);
        }
    }

    pub(super) fn spread_due(&mut self) {
        while let Some(wave) = self.spread.next_wave(self.clock) {
            let targets = match wave.count {
                0 => wave.to,
                count => self.pick(count, &wave.to),
            };
            let records = wave.keys.iter().filter_map(|key| self.fleet.record(key));
            let chunks = chunks_of(records);
            let sections: Vec<(u8, Vec<u8>)> =
                chunks.iter().map(|chunk| (TAG_FLEET_NEWS, body_of(chunk))).collect();
            for section in sections.chunks(1) {
                for target in &targets {
                    self.send_encoded(*target, section);
                }
            }
        }
    }

    /// Robots that act on a fact.
    fn concerned(&self, key: &FleetKey) -> Vec<RobotId> {
        match self.fleet.get(key.kind, &key.name) {
            Some((_, FleetValue::Assignment(assignment))) => {
                let others = assignment.others().chain(&assignment.drains);
                core::iter::once(&assignment.home).chain(others).cloned().collect()
            }
            Some(_) | None => Vec::new(),
        }
    }
}

/// Records in sections that fit one datagram each.
pub(super) fn sections_of(
    records: &[FleetRecord],
    section: fn(Vec<FleetRecord>) -> Section,
) -> Vec<Section> {
    let chunks = chunks_of(records.iter()).into_iter();
    chunks.map(|chunk| section(chunk.into_iter().cloned().collect())).collect()
}

/// Records in lots that fit one datagram each.
fn chunks_of<'a>(records: impl Iterator<Item = &'a FleetRecord>) -> Vec<Vec<&'a FleetRecord>> {
    let mut chunks: Vec<Vec<&FleetRecord>> = Vec::new();
    let mut used = usize::MAX;
    for record in records {
        let size = record.wire_len();
        used = used.saturating_add(size);
        match chunks.last_mut() {
            Some(chunk) if used <= SECTION_BYTES_MAX => chunk.push(record),
            Some(_) | None => {
                chunks.push(vec![record]);
                used = size + 2;
            }
        }
    }
    chunks
}

fn delta_len(delta: &AuthorDelta) -> usize {
    let records = delta.records.iter().map(|(_, key, value)| key.len() + value.len() + 4);
    records.sum::<usize>() + delta.robot.as_str().len() + 12
}
