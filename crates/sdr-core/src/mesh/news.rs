//! What the mesh is told at its start, what it tells, and what it counts.

use alloc::vec::Vec;
use core::{net::SocketAddr, time::Duration};

use super::Spoken;
use crate::{id::RobotId, record::FleetKey, time::Instant};

/// What is settled at the start.
#[derive(Clone, Debug)]
pub struct MeshConfig {
    /// This robot.
    pub robot: RobotId,
    /// Datagrams of other fleets are dropped.
    pub fleet: u32,
    /// Addresses to begin with.
    pub seeds: Vec<SocketAddr>,
    /// Where others may listen whom nobody named; spoken to, and never heard from.
    pub group: Option<SocketAddr>,
    /// Where this robot listens, when it may tell others.
    pub listen: Option<SocketAddr>,
    /// Time between two rounds; each differs by up to a tenth, by chance.
    pub period: Duration,
    /// Age of news at which a robot counts as gone. It is quiet at 28/115 of that, and whoever
    /// hears nobody for 3/10 of it holds itself for deaf.
    pub gone_after: Duration,
}

/// What changed by a datagram or by time, for the brain.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum MeshNews {
    /// A robot said something new of itself.
    Report(RobotId, Spoken),
    /// The fleet table has a greater version of this fact.
    Record(FleetKey),
    /// A robot is heard for the first time, or again after it was gone.
    Alive(RobotId),
    /// No fresh news of a robot for longer than usual. Common on a lossy radio; it ends
    /// without a word when news comes.
    Quiet(RobotId),
    /// No fresh news of a robot for too long.
    Gone(RobotId),
    /// This robot hears nobody at all, though somebody was alive.
    Isolated,
    /// This robot hears somebody again.
    Rejoined,
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
    /// Datagrams older than what was known of their sender: repeated, late or played back.
    pub stale: u64,
    /// Records refused because they could not be read, were too large, or had no room.
    pub refused: u64,
    /// Datagrams sent.
    pub sent: u64,
    /// Their bytes, before the seal.
    pub sent_bytes: u64,
}

/// Where the sent bytes went, and what was repaired.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct MeshTraffic {
    /// Guard beats sent ([`super::Mesh::beat_to`]), datagrams.
    pub guard: u64,
    /// Their bytes, before the seal.
    pub guard_bytes: u64,
    /// Shared records learnt by comparing tables instead of as news.
    pub caught_up: u64,
    /// Datagrams dropped because too many waited to be sent.
    pub dropped: u64,
    /// Bytes of all datagrams by section ([`super::SECTION_NAMES`]), before the seal.
    pub sections: [u64; super::SECTION_NAMES.len()],
}

/// A question to others about one robot.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Inquiry {
    /// When they were asked.
    pub asked_at: Instant,
    /// How many robots were asked.
    pub asked: usize,
    /// How many of them answered; what they knew is part of this robot's judgement by now.
    pub answered: usize,
}

/// Whether a report may wait for its turn.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Push {
    /// Others act on it: send it now.
    Now,
    /// The next turn is early enough.
    WithGossip,
}
