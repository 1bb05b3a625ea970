//! What a robot says unasked: one datagram a round, pings, guard beats.

use alloc::{
    collections::{BTreeMap, BTreeSet},
    vec,
    vec::Vec,
};
use core::{net::SocketAddr, time::Duration};

use super::{
    AskStamps, BEATS_BY_ID, BEATS_TOLD, Beat, Beats, FLEET_TOLD, Mesh, PlacedBeat, Pulse, Section,
    Sign, Standing, Summary,
    author_table::{Lookup, Seat},
    wire::{beat_len, cut},
};
use crate::{id::RobotId, time::Instant};

/// Fleets with fewer others greet two of them each round.
const SMALL_FLEET: usize = 8;
/// A round takes so much longer for each robot whose beat it carries.
const ROUND_STRETCH: Duration = Duration::from_micros(900);
/// Fleets up to this size have ids of two bytes.
const NARROW_FLEET: usize = 64;
/// Beats in one datagram then: as many bytes as [`BEATS_BY_ID`] of the short ones.
const BEATS_BY_WIDE_ID: usize = BEATS_BY_ID * beat_len(false) / beat_len(true);
/// Robots in one datagram by name, when they are new: a quarter of those that wait.
const INTRODUCED_MIN: usize = 3;
const INTRODUCED_MAX: usize = 10;
/// How often a new robot is told by name.
const INTRODUCTIONS: u8 = 3;
/// New robots that wait to be told; the others are found by comparing.
const NEWCOMERS_MAX: usize = 256;
/// Robots without an address that are asked for in one round.
const ADDRESSES_ASKED_MAX: usize = 4;
/// Whoever knows the addresses of so many robots looks for more only now and then; more than
/// are greeted by strides, since each of those counts on the few that greet it.
const ADDRESSES_ENOUGH: usize = 128;
/// Strays are tried again this often, unless nobody is heard.
const STRAY_PERIOD: Duration = Duration::from_secs(4);
/// A quiet robot is pinged at most so often.
const PING_PERIOD: Duration = Duration::from_secs(2);
/// After hearing nobody for so long, this robot asks several whether it is deaf.
const LONELY_AFTER: Duration = Duration::from_millis(1500);
/// Robots asked then, each round.
const LONELY_PEERS: usize = 3;
/// Least time between two guard beats.
const GUARD_PERIOD_MIN: Duration = Duration::from_millis(10);

/// Who is new to others, and when strays were tried.
#[derive(Clone, Debug, Default)]
pub(super) struct Told {
    newcomers: BTreeMap<Seat, u8>,
    strays_at: Option<Instant>,
}

impl Told {
    /// A robot is new, or under a new incarnation: others should hear of it by name.
    pub(super) fn introduce(&mut self, seat: Seat) {
        if self.newcomers.len() < NEWCOMERS_MAX {
            self.newcomers.insert(seat, INTRODUCTIONS);
        }
    }

    fn next_newcomers(&mut self) -> Vec<Seat> {
        let count = (self.newcomers.len() / 4).clamp(INTRODUCED_MIN, INTRODUCED_MAX);
        let some: Vec<Seat> = self.newcomers.keys().copied().take(count).collect();
        for seat in &some {
            let left = self.newcomers.get(seat).copied().unwrap_or(0);
            if left > 1 {
                self.newcomers.insert(*seat, left - 1);
            } else {
                self.newcomers.remove(seat);
            }
        }
        some
    }
}

/// Why a robot gets small signs of life.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum BeatsFor {
    /// It follows the holder of the coordinator role.
    Succession,
    /// It stands by for what runs here.
    Standbys,
}

/// Robots that get a small sign of life more often.
#[derive(Clone, Debug, Default)]
pub(super) struct Guard {
    asked: BTreeMap<BeatsFor, BTreeMap<RobotId, Duration>>,
    /// Each robot once: its shortest period, and when its next beat is due.
    due: BTreeMap<RobotId, (Duration, Instant)>,
}

impl Guard {
    pub(super) fn set(
        &mut self,
        purpose: BeatsFor,
        beats: BTreeMap<RobotId, Duration>,
        now: Instant,
    ) {
        if self.asked.get(&purpose).map_or(beats.is_empty(), |before| *before == beats) {
            return;
        }
        self.asked.insert(purpose, beats);
        let mut due: BTreeMap<RobotId, (Duration, Instant)> = BTreeMap::new();
        for (robot, period) in self.asked.values().flatten() {
            let period = (*period).max(GUARD_PERIOD_MIN);
            let before = self.due.get(robot).map(|(_, at)| *at);
            let next = before.map_or(now, |at| at.min(now + period));
            let known = due.entry(robot.clone()).or_insert((period, next));
            *known = (known.0.min(period), known.1.min(next));
        }
        self.due = due;
    }

    pub(super) fn next_deadline(&self) -> Option<Instant> {
        self.due.values().map(|(_, at)| *at).min()
    }

    fn robots(&self) -> impl Iterator<Item = &RobotId> {
        self.due.keys()
    }

    /// Those whose beat is due; their next ones are noted.
    fn take_due(&mut self, now: Instant) -> Vec<RobotId> {
        let due = self.due.iter_mut().filter(|(_, (_, at))| now >= *at);
        due.map(|(robot, (period, at))| {
            *at = now + *period;
            robot.clone()
        })
        .collect()
    }
}

/// Beats in one datagram of a fleet with so many others.
pub(super) fn beats_in_round(others: usize) -> usize {
    if others <= FLEET_TOLD { others } else { BEATS_TOLD }
}

/// Beats in one datagram of such a fleet to a robot that may not know the same others.
pub(super) fn beats_by_id(others: usize) -> usize {
    if others < NARROW_FLEET { BEATS_BY_ID } else { BEATS_BY_WIDE_ID }
}

/// Time between two rounds in a fleet with so many others: the more one says, the less often.
pub(super) fn period(shortest: Duration, others: usize) -> Duration {
    let beats = u32::try_from(others.min(FLEET_TOLD)).unwrap_or(0);
    shortest + ROUND_STRETCH * beats
}

impl Mesh {
    /// One round: release what waited, greet one or two, and whoever needs it.
    pub(super) fn hold_round(&mut self) {
        self.release_staged();
        self.repair.tidy(self.clock);
        self.inquiries.tidy(self.clock);
        let living = self.living_seats();
        for seat in self.choose(&living) {
            self.greet(seat);
        }
        self.greet_stray(living.is_empty());
        self.ping_quiet();
        if self.liveness.silence(self.clock) > LONELY_AFTER {
            for peer in self.pick(LONELY_PEERS, &[]) {
                self.send(peer, vec![Section::Ping]);
            }
        }
    }

    /// Guard beats that are due; each is the header and the link's mark alone.
    pub(super) fn beat_guards(&mut self) {
        let due = self.guard.take_due(self.clock);
        let seats = due.iter().filter_map(|robot| self.authors.seat(robot));
        let addresses: Vec<SocketAddr> =
            seats.filter_map(|seat| self.peers.address(seat)).collect();
        for address in addresses {
            let bytes = self.send(address, Vec::new());
            self.traffic.guard += 1;
            self.traffic.guard_bytes += bytes as u64;
        }
    }

    /// What every greeting holds: signs of life and hashes.
    pub(super) fn greeting(&mut self, to: Seat) -> Vec<Section> {
        if self.repair.names_agree() {
            let (summary, names) = (self.hashes(), self.authors.names_hash());
            return vec![Section::Pulse(Pulse { summary, names, beats: self.placed_beats(to) })];
        }
        vec![Section::Beats(self.beats_by_id(to)), self.summary()]
    }

    /// Hashes of what this robot holds.
    pub(super) fn summary(&self) -> Section {
        Section::Summary(self.hashes())
    }

    fn hashes(&self) -> Summary {
        Summary { fleet: self.fleet.tree().root(), roster: self.authors.hash() }
    }

    fn greet(&mut self, seat: Seat) {
        let Some(address) = self.peers.address(seat) else { return };
        let mut sections = self.greeting(seat);
        let newcomers = self.told.next_newcomers();
        sections.extend(self.stamps_for(newcomers.into_iter()));
        sections.extend(self.ask_addresses());
        sections.extend(self.next_asks());
        sections.extend(self.next_deltas());
        self.send(address, sections);
    }

    /// Asks where robots are that live and were never heard without a relay.
    fn ask_addresses(&self) -> Option<Section> {
        if self.peers.count() >= ADDRESSES_ENOUGH {
            return None;
        }
        let lacking =
            self.liveness.living().filter(|(seat, _)| self.peers.address(*seat).is_none());
        let ids: Vec<u32> =
            lacking.map(|(seat, _)| self.authors.at(seat).id).take(ADDRESSES_ASKED_MAX).collect();
        (!ids.is_empty()).then_some(Section::AskStamps(AskStamps { wide: true, ids }))
    }

    /// Doubling strides in small fleets, where nearly all news passes in every datagram; by
    /// chance in between and in large ones.
    fn choose(&mut self, living: &[Seat]) -> Vec<Seat> {
        let mut chosen = Vec::new();
        if (SMALL_FLEET..=FLEET_TOLD).contains(&living.len()) {
            let mut ring: Vec<(u32, Seat)> =
                living.iter().map(|seat| (self.authors.at(*seat).id, *seat)).collect();
            ring.push((self.authors.at(Seat::OWN).id, Seat::OWN));
            ring.sort_unstable();
            let own = ring.iter().position(|(_, seat)| *seat == Seat::OWN).unwrap_or(0);
            let ring: Vec<Seat> = ring.into_iter().map(|(_, seat)| seat).collect();
            chosen.extend(self.peers.next_by_stride(&ring, own));
        }
        let wanted = if living.len() < SMALL_FLEET { 2.min(living.len()) } else { 1 };
        while chosen.len() < wanted {
            match self.peers.next_in_turn(living, &mut self.rng) {
                Some(seat) if !chosen.contains(&seat) => chosen.push(seat),
                Some(_) | None => break,
            }
        }
        chosen
    }

    /// Beats that name robots by id, for whoever may not know the same ones.
    fn beats_by_id(&mut self, to: Seat) -> Beats {
        let wide = self.authors.count() > NARROW_FLEET;
        let room = beats_by_id(self.authors.count() - 1);
        let mut beats = Vec::new();
        for (seat, sign) in self.signs(to, room) {
            let id = cut(self.authors.at(seat).id, wide);
            match self.authors.lookup(id, wide) {
                Lookup::One(_) => beats.push(Beat { id, sign }),
                Lookup::Ambiguous => self.told.introduce(seat),
                Lookup::Unknown => {}
            }
        }
        Beats { wide, beats }
    }

    fn placed_beats(&mut self, to: Seat) -> Vec<PlacedBeat> {
        let all = self.liveness.living_count();
        let signs = self.signs(to, beats_in_round(all));
        let placed = signs.into_iter().filter_map(|(seat, sign)| {
            self.authors.place_of(seat).map(|place| PlacedBeat { place, sign })
        });
        let mut placed: Vec<PlacedBeat> = placed.collect();
        placed.sort_unstable_by_key(|beat| beat.place);
        placed
    }

    /// Signs of life of all others, or of those that are fresh and were told least.
    fn signs(&mut self, to: Seat, room: usize) -> Vec<(Seat, Sign)> {
        let preferred = self.preferred();
        let period = u64::try_from(self.config.period.as_nanos()).unwrap_or(u64::MAX);
        let mut ranked: Vec<(u64, Seat)> = Vec::with_capacity(self.liveness.living_count());
        for (seat, seen) in self.liveness.living() {
            if seat != to {
                let age = self.clock.as_nanos().saturating_sub(seen.fresh_at.as_nanos());
                let told = period.saturating_mul(u64::from(seen.told));
                let is_preferred = preferred.contains(&seat);
                let rank = if is_preferred { age / 4 } else { age.saturating_add(told) };
                ranked.push((rank, seat));
            }
        }
        if ranked.len() > room {
            ranked.select_nth_unstable(room);
            ranked.truncate(room);
        }
        let mut signs = Vec::with_capacity(ranked.len());
        for (_, seat) in ranked {
            let author = self.authors.at(seat);
            let (life, sequence) = (author.incarnation.counter, author.sequence());
            let Some(seen) = self.liveness.get_mut(seat) else { continue };
            seen.told = seen.told.saturating_add(1);
            let age = self.clock.since(seen.fresh_at);
            signs.extend(Sign::new(life, seen.heartbeat, sequence, age).map(|sign| (seat, sign)));
        }
        signs
    }

    /// Robots whose news matters most here: whom this robot guards, and the coordinator.
    pub(super) fn preferred(&self) -> BTreeSet<Seat> {
        let holder = self.fleet.role().and_then(|role| self.authors.seat(&role.holder));
        let guarded = self.guard.robots().filter_map(|robot| self.authors.seat(robot));
        guarded.chain(holder).collect()
    }

    /// Says hello where nobody is known to live.
    fn greet_stray(&mut self, alone: bool) {
        let due = self.told.strays_at.is_none_or(|at| self.clock.since(at) >= STRAY_PERIOD);
        let again = alone || self.is_isolated() || due;
        if !again && self.peers.count() >= ADDRESSES_ENOUGH {
            return;
        }
        let Some(address) = self.peers.next_stray(self.clock, again) else { return };
        self.told.strays_at = Some(self.clock);
        let mut greeting = self.greeting(Seat::OWN);
        greeting.push(Section::Ping);
        self.send(address, greeting);
    }

    /// Asks the robot that has been quiet longest without being asked for a sign of life, and
    /// others for news of it.
    fn ping_quiet(&mut self) {
        let late = self.liveness.quiet() * 5 / 4;
        let quiet = self.liveness.living().filter(|(_, seen)| {
            seen.standing == Standing::Quiet
                && self.clock.since(seen.fresh_at) >= late
                && self.clock.since(seen.pinged_at) >= PING_PERIOD
        });
        let Some((_, seat)) = quiet.map(|(seat, seen)| (seen.pinged_at, seat)).min() else {
            return;
        };
        let Some(seen) = self.liveness.get_mut(seat) else { return };
        let again = self.clock.since(seen.pinged_at) < PING_PERIOD * 2;
        seen.pinged_at = self.clock;
        if let Some(address) = self.peers.address(seat) {
            self.send(address, vec![Section::Ping]);
        }
        if again {
            let robot = self.authors.at(seat).robot.clone();
            self.inquire(&robot);
        }
    }
}
