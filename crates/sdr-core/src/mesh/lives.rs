//! Which life of this robot speaks, and what a robot without a disk does to find out.
//!
//! A life that may follow others that nobody remembers begins a random way further on, so
//! that no number it makes was made before.

use alloc::{collections::BTreeSet, vec::Vec};
use core::{net::SocketAddr, time::Duration};

use super::{Incarnation, Mesh, Section, author_table::Seat};
use crate::{id::RobotId, order::hash64, time::Instant};

/// Lives with this counter or a greater one follow a lost disk: others may hold numbers of
/// this robot's making that it does not know of.
const FORGETFUL_FROM: u64 = 1 << 16;
/// A forgetful life begins so far behind the greatest known one, and by chance up to as much
/// again.
const FORGOTTEN_LIVES: u64 = 1 << 16;
/// Seeds that a newborn must have met to know that it is new; more are not needed.
const MET_ENOUGH: usize = 16;
/// Seeds not met yet are hailed so often, so many at a time.
const HAIL_PERIOD: Duration = Duration::from_millis(150);
const HAILED_MAX: usize = 8;

/// What a robot knows of its earlier lives.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Memory {
    /// All who could know say that there were none.
    Whole,
    /// There may have been some that nobody heard here remembers.
    Lost,
}

/// A robot that does not know yet how often it lived.
#[derive(Clone, Debug, Default)]
pub(super) struct Newborn {
    /// Seeds that heard it, did not correct it, and hold the very same table.
    met: BTreeSet<SocketAddr>,
    /// One of them lived before: the fleet is not new, and what that life knew of this robot
    /// may be forgotten.
    others_lived: bool,
    hailed: usize,
    hail_at: Option<Instant>,
}

impl Mesh {
    /// Begins the first life of a robot that nobody corrected while it spoke as newborn
    /// (counter 0).
    pub fn grow_up(&mut self, memory: Memory) {
        if !self.is_newborn() {
            return;
        }
        match memory {
            Memory::Whole => self.live_as(1),
            Memory::Lost => self.outgrow(Incarnation::default()),
        }
    }

    /// Whether this robot once lost its disk, and may have forgotten what others hold of its
    /// making.
    pub fn may_have_forgotten(&self) -> bool {
        self.own.counter >= FORGETFUL_FROM || (self.is_newborn() && !self.is_new())
    }

    /// Whether somebody was heard from each configured peer since the start.
    pub fn has_heard_seeds(&self) -> bool {
        self.seeds().all(|seed| self.peers.seat_at(seed).is_some())
    }

    /// Whether `robot` never lost its disk, as far as is known.
    pub fn remembers_all(&self, robot: &RobotId) -> bool {
        let author = self.authors.author(robot);
        author.is_some_and(|author| author.incarnation.counter < FORGETFUL_FROM)
    }

    /// Whether everybody it was to begin with is in its first life too, and does not know it.
    pub fn is_new(&self) -> bool {
        let none = self.seeds().next().is_none();
        none || (self.has_met_seeds() && !self.newborn.others_lived)
    }

    /// Whether all configured peers (of many, enough of them) heard this newborn, did not
    /// correct it, and held the same table.
    pub fn has_met_seeds(&self) -> bool {
        let wanted = self.seeds().count().min(MET_ENOUGH);
        wanted > 0 && self.newborn.met.len() >= wanted
    }

    /// Speaks under a greater incarnation than `seen`, which others hold of this robot.
    ///
    /// The first correction of a life proves that memory was lost; whether what others
    /// remember was the last life is known to nobody.
    pub(super) fn outgrow(&mut self, seen: Incarnation) {
        let next = seen.counter.max(self.own.counter).saturating_add(1);
        if self.own.counter >= FORGETFUL_FROM {
            return self.live_as(next);
        }
        let chance = hash64(&self.own.nonce.to_le_bytes()) % FORGOTTEN_LIVES;
        self.live_as(next.saturating_add(FORGOTTEN_LIVES + chance));
    }

    /// `from` holds the same table as this newborn.
    pub(super) fn meet(&mut self, from: SocketAddr) {
        if !self.is_newborn() || !self.config.seeds.contains(&from) {
            return;
        }
        let seat = self.peers.seat_at(from);
        let Some(seat) = seat.filter(|seat| self.links.is_echoed(*seat)) else { return };
        self.newborn.met.insert(from);
        self.newborn.others_lived |= self.authors.at(seat).incarnation.counter > 1;
    }

    /// One of the seeds is this robot's own address.
    pub(super) fn meet_self(&mut self, from: SocketAddr) {
        if self.is_newborn() && self.config.seeds.contains(&from) {
            self.newborn.met.insert(from);
        }
    }

    /// A newborn asks its seeds whether they know it.
    pub(super) fn hail_seeds(&mut self) {
        if self.hail_at().is_none_or(|at| self.clock < at) {
            return;
        }
        self.newborn.hail_at = Some(self.clock + HAIL_PERIOD);
        let unmet = self.seeds().filter(|seed| !self.newborn.met.contains(seed));
        let unmet: Vec<SocketAddr> = unmet.collect();
        let first = self.newborn.hailed % unmet.len().max(1);
        let some = unmet.iter().cycle().skip(first).take(unmet.len().min(HAILED_MAX));
        let some: Vec<SocketAddr> = some.copied().collect();
        self.newborn.hailed += some.len();
        for seed in some {
            let mut greeting = self.greeting(Seat::OWN);
            greeting.push(Section::Ping);
            self.send(seed, greeting);
        }
    }

    /// When a newborn asks again.
    pub(super) fn hail_at(&self) -> Option<Instant> {
        let hails = self.is_newborn() && !self.has_met_seeds() && self.seeds().next().is_some();
        hails.then(|| self.newborn.hail_at.unwrap_or(self.born_at))
    }

    fn is_newborn(&self) -> bool {
        self.own.counter == 0
    }

    fn seeds(&self) -> impl Iterator<Item = SocketAddr> {
        let own = self.config.listen;
        self.config.seeds.iter().copied().filter(move |seed| Some(*seed) != own)
    }

    fn live_as(&mut self, counter: u64) {
        self.own.counter = counter;
        self.newborn = Newborn::default();
        self.authors.reincarnate(self.own);
        self.spread.say_anew();
        self.told.introduce(Seat::OWN);
        // under the new life others know nothing of it
        self.push_own();
    }
}
