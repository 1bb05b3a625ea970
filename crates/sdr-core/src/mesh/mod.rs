//! The gossip mesh: two replicated tables and everybody's signs of life, in datagrams of at
//! most 1200 bytes.
//!
//! ```text
//!            handle_datagram            handle_tick
//!                  │                         │
//!   receive ───────┤                         ├─────── round: one datagram to one robot
//!                  ▼                         ▼
//!   liveness   who is alive       author_table  what each robot says of itself
//!   links      how pairs hear     fleet_table   what the fleet agrees on
//!                  │                         │
//!                  └───▶ news, outbox ◀──────┴── spread: news at once, with repeats
//!                                                repair: what differs, on difference only
//! ```
//!
//! Each round a robot tells one other whom it heard lately (beats of five bytes) and a hash of
//! what it holds; more is said only where hashes or sequences differ. `docs/mesh.md` has the
//! bytes and the guarantees.

mod author;
mod author_table;
mod commons;
mod fact;
mod fact_index;
mod fleet_table;
mod fleet_tree;
mod inquiry;
mod links;
mod liveness;
mod lives;
mod near;
mod news;
mod outbox;
mod peers;
mod receive;
mod repair;
mod round;
mod saying;
mod spread;
#[cfg(test)]
mod tests;
mod tombs;
mod view;
mod wire;

use alloc::{
    collections::{BTreeMap, VecDeque},
    vec::Vec,
};
use core::{net::SocketAddr, time::Duration};

pub use author::{Author, Incarnation};
pub use author_table::AuthorTable;
pub use commons::Commons;
pub use fact::{Fact, Facts, FleetRecord};
pub use fleet_table::{FleetTable, Merge, TableChange};
pub use liveness::Standing;
pub use lives::Memory;
pub use news::{Inquiry, MeshConfig, MeshCounters, MeshNews, MeshTraffic, Push};
pub use saying::{AuthorKey, Saying, Spoken};
pub use wire::{
    AskNews, AskStamps, AuthorDelta, Beat, Beats, DATAGRAM_BYTES_MAX, Datagram, Echo, FleetEntries,
    FleetNodes, Header, LinkMark, News, PlacedBeat, Pulse, RosterPiece, SEAL_BYTES_MAX,
    SECTION_NAMES, Section, Sign, Stamp, Summary, WireError,
};

use crate::{id::RobotId, order::hash64, report::Report, rng::Rng, time::Instant, units::Permille};
use author_table::{Admission, Seat};
use inquiry::Inquiries;
use links::Links;
use liveness::Liveness;
use lives::Newborn;
use near::Near;
use peers::Peers;
use repair::Repair;
pub use round::BeatsFor;
use round::{Guard, Told};
use spread::Spread;
use wire::RecordRef;

/// Fleets with at most so many others are told whole in each datagram ...
const FLEET_TOLD: usize = 100;
/// ... of larger ones the freshest so many, by turns.
const BEATS_TOLD: usize = 75;
/// Beats in one datagram when robots are named by ids of two bytes.
const BEATS_BY_ID: usize = 40;
/// Datagrams in answer to one, so that a small question has no huge answer.
const ANSWERS_MAX: usize = 12;

/// The mesh of one robot: pure, driven by `handle_*`, drained by `poll_*`.
#[derive(Debug)]
pub struct Mesh {
    config: MeshConfig,
    own: Incarnation,
    born_at: Instant,
    /// The last moment that the caller gave.
    clock: Instant,
    /// Datagrams until then may have waited for this robot's pause.
    late_until: Instant,
    late_by: Duration,
    in_step: bool,
    newborn: Newborn,
    authors: AuthorTable,
    fleet: FleetTable,
    liveness: Liveness,
    links: Links,
    peers: Peers,
    near: Near,
    spread: Spread,
    repair: Repair,
    told: Told,
    guard: Guard,
    inquiries: Inquiries,
    rng: Rng,
    round_at: Instant,
    outbox: VecDeque<(SocketAddr, Vec<u8>)>,
    news: VecDeque<MeshNews>,
    counters: MeshCounters,
    traffic: MeshTraffic,
}

impl Mesh {
    /// A mesh that speaks as `own`, knowing `fleet` and `peers` from before.
    pub fn new(
        config: MeshConfig,
        own: Incarnation,
        fleet: FleetTable,
        peers: &[SocketAddr],
        now: Instant,
    ) -> Self {
        let mut rng = Rng::new(hash64(config.robot.as_str().as_bytes()) ^ u64::from(own.nonce));
        let known = config.seeds.iter().chain(peers).copied();
        let mut liveness = Liveness::new(config.gone_after, config.period, now);
        liveness.reset(Seat::OWN);
        Self {
            authors: AuthorTable::new(config.robot.clone(), own, fleet.commons()),
            liveness,
            links: Links::default(),
            peers: Peers::new(known, config.listen),
            near: Near::default(),
            spread: Spread::default(),
            repair: Repair::default(),
            told: Told::default(),
            guard: Guard::default(),
            inquiries: Inquiries::default(),
            round_at: now + config.period * u32::try_from(rng.below(256)).unwrap_or(0) / 1024,
            rng,
            config,
            own,
            born_at: now,
            clock: now,
            late_until: now,
            late_by: Duration::ZERO,
            in_step: false,
            newborn: Newborn::default(),
            fleet,
            outbox: VecDeque::new(),
            news: VecDeque::new(),
            counters: MeshCounters::default(),
            traffic: MeshTraffic::default(),
        }
    }

    /// Takes a datagram; garbage is counted and dropped.
    pub fn handle_datagram(&mut self, now: Instant, from: SocketAddr, bytes: &[u8]) {
        self.clock = now;
        let known = |record: &RecordRef<'_>| self.fleet.holds(record);
        match Datagram::decode_news(bytes, self.config.fleet, &known) {
            Ok(datagram) if datagram.header.from == self.config.robot => {
                self.handle_own_name(from, &datagram.header);
            }
            Ok(datagram) => {
                self.counters.received += 1;
                self.take_in(from, datagram);
            }
            Err(WireError::Foreign) => self.counters.foreign += 1,
            Err(
                WireError::TooLong(_)
                | WireError::Short(_)
                | WireError::Magic
                | WireError::Version(_)
                | WireError::Body(_),
            ) => self.counters.malformed += 1,
        }
    }

    /// Does what is due: a round, repeats of news, guard beats, and judgement of who is gone.
    pub fn handle_tick(&mut self, now: Instant) {
        self.clock = now;
        if now >= self.round_at {
            let period = round::period(self.config.period, self.liveness.living_count());
            let chance = u32::try_from(self.rng.below(201)).unwrap_or(0);
            self.round_at = now + period - period / 10 + period / 10 * chance / 100;
            self.hold_round();
        }
        self.spread_due();
        self.compare_on();
        self.hail_seeds();
        self.beat_guards();
        self.judge();
    }

    /// Moves every window forward by a pause of this robot, so that its own deafness does
    /// not bury the others. Call it before the first `handle` after the pause.
    pub fn forgive_pause(&mut self, pause: Duration) {
        let now = self.clock + pause;
        self.liveness.forgive_pause(pause, now);
        self.links.forgive();
        self.late_by = pause;
        self.late_until = now + Duration::from_millis(50);
    }

    /// Says something of this robot; pushed at once when `push`.
    pub fn report(&mut self, report: &Report, push: Push) {
        self.authors.stage(report);
        if push == Push::Now {
            self.authors.release_one(&AuthorKey::of(report));
            self.push_own();
        }
    }

    /// Takes back what was said under `key`.
    pub fn retract(&mut self, key: &AuthorKey) {
        if self.authors.unstage(key) {
            self.authors.release_one(key);
            self.push_own();
        }
    }

    /// Puts records of this robot's making into the fleet table and pushes them.
    pub fn publish(&mut self, records: Vec<FleetRecord>) {
        let mut fresh = Vec::new();
        for record in records {
            match self.fleet.merge(record.clone()) {
                Merge::News => {
                    self.news.push_back(MeshNews::Record(record.key.clone()));
                    fresh.push(record);
                }
                Merge::Refused => self.counters.refused += 1,
                Merge::Known | Merge::Older => {}
            }
        }
        self.spread_own(fresh);
    }

    /// Sends small signs of life to these robots, each at its period, from now on, whatever
    /// else is said; replaces what was asked for the same purpose before.
    pub fn beat_to(&mut self, purpose: BeatsFor, beats: BTreeMap<RobotId, Duration>) {
        self.guard.set(purpose, beats, self.clock);
    }

    /// Asks up to four living robots for fresh news of `robot`; what they know becomes part
    /// of this robot's judgement as it arrives.
    pub fn ask_about(&mut self, now: Instant, robot: &RobotId) {
        self.clock = now;
        self.inquire(robot);
    }

    /// The next datagram to send, at most [`DATAGRAM_BYTES_MAX`].
    pub fn poll_send(&mut self) -> Option<(SocketAddr, Vec<u8>)> {
        let (to, bytes) = self.outbox.pop_front()?;
        self.counters.sent += 1;
        self.counters.sent_bytes += bytes.len() as u64;
        Some((to, bytes))
    }

    /// The next thing that changed.
    pub fn poll_news(&mut self) -> Option<MeshNews> {
        self.news.pop_front()
    }

    /// When `handle_tick` is due.
    pub fn next_deadline(&self) -> Instant {
        let others = self.liveness.next_deadline().into_iter();
        let others = others.chain(self.spread.next_deadline()).chain(self.guard.next_deadline());
        let others = others.chain(self.repair.next_deadline()).chain(self.hail_at());
        others.fold(self.round_at, Instant::min)
    }

    /// What robots said of themselves.
    pub fn authors(&self) -> &AuthorTable {
        &self.authors
    }

    /// What the fleet agreed on.
    pub fn fleet(&self) -> &FleetTable {
        &self.fleet
    }

    /// What changed in the fleet table since the last call, for the disk; `None` when it is
    /// too much to tell apart.
    pub fn take_change(&mut self) -> Option<TableChange> {
        self.fleet.take_change()
    }

    /// How far the loss of the link to `robot` differs by chance from one count to the next,
    /// one standard deviation.
    pub fn link_noise(&self, robot: &RobotId) -> Permille {
        self.authors.seat(robot).map_or(Permille(1000), |seat| self.links.noise(seat))
    }

    /// Addresses heard so far.
    pub fn peer_addresses(&self) -> Vec<SocketAddr> {
        self.peers.addresses()
    }

    /// Counters since the start.
    pub fn counters(&self) -> MeshCounters {
        self.counters
    }

    /// What was sent for what since the start.
    pub fn traffic(&self) -> MeshTraffic {
        self.traffic
    }

    /// The incarnation this robot speaks under.
    pub fn incarnation(&self) -> Incarnation {
        self.own
    }

    /// Seats of the living, in order.
    fn living_seats(&self) -> Vec<Seat> {
        self.liveness.living().map(|(seat, _)| seat).collect()
    }

    /// Gives the robot a seat under this incarnation.
    fn admit(&mut self, robot: &RobotId, incarnation: Incarnation) -> Admission {
        let admission = self.authors.admit(robot, incarnation);
        match admission {
            Admission::New(seat) => {
                self.liveness.reset(seat);
                self.links.reset(seat);
                self.told.introduce(seat);
            }
            Admission::Full => self.counters.refused += 1,
            Admission::Known(_) | Admission::Outdated(_) => {}
        }
        admission
    }
}
