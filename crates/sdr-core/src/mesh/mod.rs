//! The gossip mesh: two replicated tables, spread in datagrams of at most 1200 bytes.
//!
//! Every gossip period a robot greets a few others with its digests; each answer brings
//! what the asker lacks, and asks for what the answerer lacks (Scuttlebutt, van Renesse et
//! al. 2008, for reports; hashed buckets for the fleet table). What concerns others at
//! once is pushed without waiting for the next round.

mod author_table;
mod exchange;
mod fleet_table;
mod links;
mod liveness;
mod peers;
#[cfg(test)]
mod tests;
mod wire;

use alloc::{collections::VecDeque, vec::Vec};
use core::{net::SocketAddr, time::Duration};

pub use author_table::{Author, AuthorKey, AuthorTable, Incarnation};
pub use fleet_table::{FleetRecord, FleetTable, Merge};
pub use wire::{
    AuthorDelta, AuthorDigest, AuthorStamp, DATAGRAM_BYTES_MAX, Datagram, FleetBucket, Section,
    WireError,
};

use crate::{
    id::RobotId,
    order::hash64,
    record::FleetKey,
    report::{LinkReport, Report},
    rng::Rng,
    time::Instant,
};
use links::Links;
use liveness::Liveness;
use peers::Peers;

/// Robots that a push reaches directly; gossip brings it to the others.
const PUSH_PEERS_MAX: usize = 8;
/// Robots greeted in one round of gossip.
const GOSSIP_PEERS: usize = 2;
/// Robots a fresh fleet record is forwarded to.
const FORWARD_PEERS: usize = 3;

/// What is settled at the start.
#[derive(Clone, Debug)]
pub struct MeshConfig {
    /// This robot.
    pub robot: RobotId,
    /// Datagrams of other fleets are dropped.
    pub fleet: u32,
    /// Addresses to begin with.
    pub seeds: Vec<SocketAddr>,
    /// Where this robot listens, when it may tell others.
    pub listen: Option<SocketAddr>,
    /// Time between two rounds.
    pub period: Duration,
    /// Age of news at which a robot counts as gone.
    pub gone_after: Duration,
}

/// What changed by a datagram or by time, for the brain.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum MeshNews {
    /// A robot said something new of itself.
    Report(RobotId),
    /// The fleet table has a greater version of this fact.
    Record(FleetKey),
    /// A robot is heard for the first time, or again.
    Alive(RobotId),
    /// No fresh news of a robot for too long.
    Gone(RobotId),
    /// Somebody else speaks under this robot's name.
    DuplicateId(SocketAddr),
}

/// Counters for operators; a broken packet is counted and dropped.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct MeshCounters {
    /// Datagrams taken in.
    pub received: u64,
    /// Datagrams that were garbage, cut short, too long, or of an unknown version.
    pub malformed: u64,
    /// Datagrams of other fleets.
    pub foreign: u64,
    /// Datagrams that brought nothing newer than what was known of their sender: repeated,
    /// late or played back.
    pub stale: u64,
    /// Records refused because they could not be read or were too large.
    pub refused: u64,
    /// Datagrams sent.
    pub sent: u64,
    /// Their bytes.
    pub sent_bytes: u64,
}

/// The mesh of one robot: pure, driven by `handle_*`, drained by `poll_*`.
#[derive(Debug)]
pub struct Mesh {
    config: MeshConfig,
    own: Incarnation,
    heartbeat: u64,
    /// Own records up to this one were pushed.
    pushed: u64,
    in_step: bool,
    authors: AuthorTable,
    fleet: FleetTable,
    liveness: Liveness,
    links: Links,
    peers: Peers,
    rng: Rng,
    round_at: Instant,
    outbox: VecDeque<(SocketAddr, Vec<u8>)>,
    news: VecDeque<MeshNews>,
    counters: MeshCounters,
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
        let seeds: Vec<SocketAddr> = config.seeds.iter().chain(peers).copied().collect();
        Self {
            rng: Rng::new(hash64(config.robot.as_str().as_bytes()) ^ u64::from(own.nonce)),
            authors: AuthorTable::new(config.robot.clone(), own),
            liveness: Liveness::new(config.gone_after),
            links: Links::default(),
            peers: Peers::new(seeds, config.listen),
            config,
            own,
            heartbeat: 0,
            pushed: 0,
            in_step: false,
            fleet,
            round_at: now,
            outbox: VecDeque::new(),
            news: VecDeque::new(),
            counters: MeshCounters::default(),
        }
    }

    /// Takes a datagram; garbage is counted and dropped.
    pub fn handle_datagram(&mut self, now: Instant, from: SocketAddr, bytes: &[u8]) {
        match Datagram::decode(bytes, self.config.fleet) {
            Ok(datagram) if datagram.from == self.config.robot => {
                self.handle_own_name(from, &datagram);
            }
            Ok(datagram) => {
                self.counters.received += 1;
                self.take_in(now, from, datagram);
            }
            Err(WireError::Foreign) => self.counters.foreign += 1,
            Err(_) => self.counters.malformed += 1,
        }
    }

    /// Does what is due: a round of gossip, and judgement of who is gone.
    pub fn handle_tick(&mut self, now: Instant) {
        if now >= self.round_at {
            self.round_at = now + self.config.period;
            self.heartbeat += 1;
            self.authors.beat(self.heartbeat);
            self.greet_some(now);
        }
        for robot in self.liveness.judge(now) {
            self.news.push_back(MeshNews::Gone(robot));
        }
    }

    /// Moves every window forward by a pause of this robot, so that its own deafness does
    /// not bury the others.
    pub fn forgive_pause(&mut self, pause: Duration) {
        self.liveness.forgive(pause);
        self.links.forgive();
    }

    /// Says something of this robot; pushed at once when `push`.
    pub fn report(&mut self, report: &Report, push: Push) {
        if self.authors.set_own(report) && push == Push::Now {
            self.push_own();
        }
    }

    /// Takes back what was said under `key`.
    pub fn retract(&mut self, key: &AuthorKey) {
        if self.authors.remove_own(key) {
            self.push_own();
        }
    }

    /// Puts records of this robot's making into the fleet table and pushes them.
    pub fn publish(&mut self, records: Vec<FleetRecord>) {
        let mut fresh = Vec::new();
        for record in records {
            if self.fleet.merge(record.clone()) == Merge::News {
                self.news.push_back(MeshNews::Record(record.key.clone()));
                fresh.push(record);
            }
        }
        let peers = self.peers.pick(PUSH_PEERS_MAX, &mut self.rng, &[]);
        self.send_records(&fresh, &peers);
    }

    /// The next datagram to send.
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
        match self.liveness.next_deadline() {
            Some(gone_at) => gone_at.min(self.round_at),
            None => self.round_at,
        }
    }

    /// What robots said of themselves.
    pub fn authors(&self) -> &AuthorTable {
        &self.authors
    }

    /// What the fleet agreed on.
    pub fn fleet(&self) -> &FleetTable {
        &self.fleet
    }

    /// Whether fresh news of `robot` arrives; always of this robot.
    pub fn is_alive(&self, robot: &RobotId) -> bool {
        *robot == self.config.robot || self.liveness.is_alive(robot)
    }

    /// Whether some other robot held the very same fleet table at least once since the start:
    /// what this robot missed while it was away is known by now.
    pub fn is_in_step(&self) -> bool {
        self.in_step
    }

    /// Age of the last fresh news of `robot`.
    pub fn age(&self, robot: &RobotId, now: Instant) -> Option<Duration> {
        match *robot == self.config.robot {
            true => Some(Duration::ZERO),
            false => self.liveness.age(robot, now),
        }
    }

    /// Other robots that are alive.
    pub fn alive(&self) -> impl Iterator<Item = &RobotId> {
        self.liveness.alive()
    }

    /// Links of this robot, measured by it.
    pub fn links(&self) -> impl Iterator<Item = (&RobotId, LinkReport)> {
        self.links.reports()
    }

    /// Addresses heard so far.
    pub fn peer_addresses(&self) -> Vec<SocketAddr> {
        self.peers.addresses()
    }

    /// Counters since the start.
    pub fn counters(&self) -> MeshCounters {
        self.counters
    }

    /// The incarnation this robot speaks under.
    pub fn incarnation(&self) -> Incarnation {
        self.own
    }
}

/// Whether a report may wait for the next round of gossip.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Push {
    /// Others act on it: send it now.
    Now,
    /// The next round is early enough.
    WithGossip,
}
