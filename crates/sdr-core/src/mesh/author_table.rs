//! What each robot says of itself, and who is known at all.
//!
//! Every robot ever heard of has a seat: a small number that stays, so that nothing on the
//! path of a datagram compares names. Seat 0 is this robot's own.

use alloc::{
    collections::{BTreeMap, BTreeSet},
    sync::Arc,
    vec::Vec,
};

use super::{
    author::{Author, Incarnation, Learned},
    commons::Commons,
    fact::fold,
    saying::AuthorKey,
    wire::{AuthorDelta, cut, last_of},
};
use crate::{id::RobotId, order::hash64, report::Report};

/// Most robots known; more are refused.
pub(super) const AUTHORS_MAX: usize = 2000;

/// The place of a robot in all tables of this mesh.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(super) struct Seat(usize);

impl Seat {
    /// This robot's.
    pub(super) const OWN: Self = Self(0);

    pub(super) fn at(index: usize) -> Self {
        Self(index)
    }

    pub(super) fn index(self) -> usize {
        self.0
    }
}

/// What the table says to a robot with its incarnation.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Admission {
    /// It has this seat.
    Known(Seat),
    /// It took this seat just now, or sits there under a greater incarnation than before.
    New(Seat),
    /// It has this seat under a greater incarnation.
    Outdated(Seat),
    /// No room.
    Full,
}

impl Admission {
    /// Its seat, when it speaks under the greatest incarnation known.
    pub(super) fn seat(self) -> Option<Seat> {
        match self {
            Self::Known(seat) | Self::New(seat) => Some(seat),
            Self::Outdated(_) | Self::Full => None,
        }
    }
}

/// Whom a shortened id stands for.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Lookup {
    One(Seat),
    Unknown,
    Ambiguous,
}

/// All authors, this robot among them.
#[derive(Clone, Debug)]
pub struct AuthorTable {
    seats: Vec<Author>,
    by_name: BTreeMap<RobotId, Seat>,
    /// All ids, sorted, and the seat of each: looked through for every beat.
    ids: Vec<u32>,
    id_seats: Vec<Seat>,
    /// XOR over all ids.
    hash: u32,
    /// All seats in the order of their robots' names, and the place of each seat among them.
    seats_by_name: Vec<Seat>,
    places: Vec<u16>,
    /// XOR over hashes of all names.
    names_hash: u32,
    /// Own records that changed and wait for their release.
    staged: BTreeSet<AuthorKey>,
    commons: Option<Arc<dyn Commons>>,
}

impl AuthorTable {
    pub(super) fn new(me: RobotId, own: Incarnation, commons: Option<Arc<dyn Commons>>) -> Self {
        let author = Author::new(me.clone(), own);
        Self {
            hash: author.id,
            seats_by_name: Vec::from([Seat::OWN]),
            places: Vec::from([0]),
            names_hash: name_hash(&me),
            by_name: BTreeMap::from([(me, Seat::OWN)]),
            ids: Vec::from([author.id]),
            id_seats: Vec::from([Seat::OWN]),
            seats: Vec::from([author]),
            staged: BTreeSet::new(),
            commons,
        }
    }

    /// All robots ever heard of, this one included, by name.
    pub fn robots(&self) -> impl Iterator<Item = &RobotId> {
        self.by_name.keys()
    }

    /// What `robot` says at present.
    pub fn author(&self, robot: &RobotId) -> Option<&Author> {
        self.by_name.get(robot).map(|seat| &self.seats[seat.0])
    }

    pub(super) fn seat(&self, robot: &RobotId) -> Option<Seat> {
        self.by_name.get(robot).copied()
    }

    pub(super) fn at(&self, seat: Seat) -> &Author {
        &self.seats[seat.0]
    }

    /// Takes what an author said.
    pub(super) fn learn(&mut self, seat: Seat, delta: AuthorDelta) -> Learned {
        self.seats[seat.0].learn(delta, self.commons.as_deref())
    }

    /// Robots known, this one included.
    pub fn count(&self) -> usize {
        self.seats.len()
    }

    /// Hash over all robots known and their incarnations.
    pub(super) fn hash(&self) -> u32 {
        self.hash
    }

    /// Whom the id in a beat stands for.
    pub(super) fn lookup(&self, id: u32, wide: bool) -> Lookup {
        let low = cut(id, wide);
        let mut found = self.ids(low, last_of(low, wide));
        match (found.next(), found.next()) {
            (Some((_, seat)), None) => Lookup::One(seat),
            (None, _) => Lookup::Unknown,
            (Some(_), Some(_)) => Lookup::Ambiguous,
        }
    }

    /// Whom a whole id stands for.
    pub(super) fn by_id(&self, id: u32) -> Option<Seat> {
        self.ids(id, id).next().map(|(_, seat)| seat)
    }

    /// All ids in a range, with their seats.
    pub(super) fn ids(&self, low: u32, high: u32) -> impl Iterator<Item = (u32, Seat)> {
        let first = self.place(low);
        let ids = self.ids[first..].iter().copied();
        ids.zip(self.id_seats[first..].iter().copied()).take_while(move |(id, _)| *id <= high)
    }

    /// Whose name has so many smaller ones.
    pub(super) fn at_place(&self, place: usize) -> Option<Seat> {
        self.seats_by_name.get(place).copied()
    }

    /// How many names come before that of `seat`.
    pub(super) fn place_of(&self, seat: Seat) -> Option<u16> {
        self.places.get(seat.0).copied()
    }

    /// Hash over the names of all robots known.
    pub(super) fn names_hash(&self) -> u32 {
        self.names_hash
    }

    /// Index of the first id that is not less than `id`. Ids are hashes, evenly spread: the
    /// place is near where their share of all numbers says.
    fn place(&self, id: u32) -> usize {
        let guess = (u64::from(id) * self.ids.len() as u64) >> 32;
        let mut place = usize::try_from(guess).unwrap_or(0);
        while place > 0 && self.ids[place - 1] >= id {
            place -= 1;
        }
        while place < self.ids.len() && self.ids[place] < id {
            place += 1;
        }
        place
    }

    /// The seat of a robot under an incarnation; a new seat, or the old one emptied, when
    /// that is news.
    pub(super) fn admit(&mut self, robot: &RobotId, incarnation: Incarnation) -> Admission {
        match self.by_name.get(robot) {
            Some(seat) => {
                let known = self.seats[seat.0].incarnation;
                match incarnation.cmp(&known) {
                    core::cmp::Ordering::Equal => Admission::Known(*seat),
                    core::cmp::Ordering::Less => Admission::Outdated(*seat),
                    core::cmp::Ordering::Greater if *seat == Seat::OWN => Admission::Known(*seat),
                    core::cmp::Ordering::Greater => {
                        let seat = *seat;
                        self.replace(seat, Author::new(robot.clone(), incarnation));
                        Admission::New(seat)
                    }
                }
            }
            None if self.seats.len() >= AUTHORS_MAX => Admission::Full,
            None => {
                let seat = Seat(self.seats.len());
                let author = Author::new(robot.clone(), incarnation);
                self.hash ^= author.id;
                self.by_name.insert(robot.clone(), seat);
                self.index(author.id, seat);
                self.seats.push(author);
                self.names_hash ^= name_hash(robot);
                self.order_by_name(seat);
                Admission::New(seat)
            }
        }
    }

    /// Speaks under a greater incarnation from now on; everything is said anew.
    pub(super) fn reincarnate(&mut self, incarnation: Incarnation) {
        let mut own = self.seats[Seat::OWN.0].clone();
        own.reincarnate(incarnation);
        self.replace(Seat::OWN, own);
    }

    /// Puts an own record down; whether it changed.
    pub(super) fn stage(&mut self, report: &Report) -> bool {
        let key = AuthorKey::of(report);
        let changed = self.seats[Seat::OWN.0].stage(&key, report);
        if changed {
            self.staged.insert(key);
        }
        changed
    }

    /// Takes an own record back; whether there was one.
    pub(super) fn unstage(&mut self, key: &AuthorKey) -> bool {
        let changed = self.seats[Seat::OWN.0].unstage(key);
        if changed {
            self.staged.insert(key.clone());
        }
        changed
    }

    /// Lets others hear of staged records, as many as take `bytes`, one at least.
    pub(super) fn release(&mut self, bytes: usize) {
        let mut used = 0;
        while used < bytes {
            let Some(key) = self.staged.pop_first() else { break };
            used += self.seats[Seat::OWN.0].release(&key);
        }
    }

    /// Lets others hear of one record.
    pub(super) fn release_one(&mut self, key: &AuthorKey) {
        if self.staged.remove(key) {
            self.seats[Seat::OWN.0].release(key);
        }
    }

    /// Whether records wait for their release.
    pub(super) fn has_staged(&self) -> bool {
        !self.staged.is_empty()
    }

    fn replace(&mut self, seat: Seat, author: Author) {
        let before = self.seats[seat.0].id;
        let entry = self.ids.iter().zip(&self.id_seats).position(|(_, known)| *known == seat);
        if let Some(place) = entry {
            self.ids.remove(place);
            self.id_seats.remove(place);
        }
        self.hash ^= before ^ author.id;
        self.index(author.id, seat);
        self.seats[seat.0] = author;
    }

    /// Puts the newest seat where its name belongs.
    fn order_by_name(&mut self, seat: Seat) {
        let robot = &self.seats[seat.0].robot;
        let before = |other: &Seat| self.seats[other.0].robot < *robot;
        let first = self.seats_by_name.partition_point(before);
        self.seats_by_name.insert(first, seat);
        self.places.push(0);
        for (place, seat) in self.seats_by_name.iter().enumerate().skip(first) {
            self.places[seat.0] = u16::try_from(place).unwrap_or(u16::MAX);
        }
    }

    fn index(&mut self, id: u32, seat: Seat) {
        let place = self.place(id);
        self.ids.insert(place, id);
        self.id_seats.insert(place, seat);
    }
}

fn name_hash(robot: &RobotId) -> u32 {
    fold(hash64(robot.as_str().as_bytes()))
}
