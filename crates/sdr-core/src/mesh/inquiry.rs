//! Asking others for fresh news of one robot.

use alloc::{
    collections::{BTreeMap, BTreeSet},
    vec,
    vec::Vec,
};
use core::{net::SocketAddr, time::Duration};

use super::{AskNews, Inquiry, Mesh, News, Section, author_table::Seat, wire::Stamp};
use crate::{id::RobotId, time::Instant};

/// Robots asked at once.
const ASKED_MAX: usize = 4;
/// Robots in one question.
pub(super) const SUBJECTS_MAX: usize = 8;
/// Questions kept.
const INQUIRIES_MAX: usize = 64;
/// How long an answer is worth anything.
const KEPT_FOR: Duration = Duration::from_secs(10);

#[derive(Clone, Debug)]
struct Open {
    number: u16,
    asked_at: Instant,
    asked: usize,
    answered: BTreeSet<Seat>,
}

/// Questions under way.
#[derive(Clone, Debug, Default)]
pub(super) struct Inquiries {
    open: BTreeMap<RobotId, Open>,
    number: u16,
}

impl Inquiries {
    pub(super) fn get(&self, robot: &RobotId) -> Option<Inquiry> {
        self.open.get(robot).map(|open| Inquiry {
            asked_at: open.asked_at,
            asked: open.asked,
            answered: open.answered.len(),
        })
    }

    pub(super) fn tidy(&mut self, now: Instant) {
        self.open.retain(|_, open| now.since(open.asked_at) < KEPT_FOR);
    }

    fn open(&mut self, robot: &RobotId, asked: usize, now: Instant) -> u16 {
        self.tidy(now);
        self.number = self.number.wrapping_add(1);
        if self.open.len() < INQUIRIES_MAX || self.open.contains_key(robot) {
            let number = self.number;
            let open = Open { number, asked_at: now, asked, answered: BTreeSet::new() };
            self.open.insert(robot.clone(), open);
        }
        self.number
    }

    fn note(&mut self, number: u16, from: Seat) {
        let open = self.open.values_mut().find(|open| open.number == number);
        if let Some(open) = open {
            open.answered.insert(from);
        }
    }
}

impl Mesh {
    /// Asks those whose own news is the freshest.
    pub(super) fn inquire(&mut self, robot: &RobotId) {
        let mut able: Vec<(Instant, Seat)> = self
            .liveness
            .living()
            .filter(|(seat, _)| self.authors.at(*seat).robot != *robot)
            .filter(|(seat, _)| self.peers.address(*seat).is_some())
            .map(|(seat, seen)| (seen.direct_at.unwrap_or(Instant::ZERO), seat))
            .collect();
        able.sort_unstable_by(|a, b| b.cmp(a));
        able.truncate(ASKED_MAX);
        let number = self.inquiries.open(robot, able.len(), self.clock);
        for (_, seat) in able {
            if let Some(address) = self.peers.address(seat) {
                let ask = AskNews { number, robots: vec![robot.clone()] };
                self.send(address, vec![Section::AskNews(ask)]);
            }
        }
    }

    pub(super) fn answer_inquiry(&self, ask: &AskNews, answer: &mut Vec<Section>) {
        let seats =
            ask.robots.iter().take(SUBJECTS_MAX).filter_map(|robot| self.authors.seat(robot));
        let stamps = seats.filter_map(|seat| self.stamp(seat)).collect();
        answer.push(Section::News(News { number: ask.number, stamps }));
    }

    pub(super) fn take_news(&mut self, seat: Seat, news: News) {
        for stamp in news.stamps.into_iter().take(SUBJECTS_MAX) {
            self.take_stamp(stamp);
        }
        self.inquiries.note(news.number, seat);
    }

    /// How far a robot is known; `None` when it was never heard.
    pub(super) fn stamp(&self, seat: Seat) -> Option<Stamp> {
        let author = self.authors.at(seat);
        let (heartbeat, fresh_at) = match seat {
            Seat::OWN => (self.heartbeat(), self.clock),
            _ => {
                let seen = self.liveness.get(seat)?;
                (seen.heartbeat, seen.fresh_at)
            }
        };
        Some(Stamp {
            robot: author.robot.clone(),
            incarnation: author.incarnation,
            heartbeat,
            sequence: author.sequence(),
            age_ms: u64::try_from(self.clock.since(fresh_at).as_millis()).unwrap_or(u64::MAX),
            address: self.peers.address(seat),
        })
    }

    /// News of a robot by name.
    pub(super) fn take_stamp(&mut self, stamp: Stamp) {
        if stamp.robot == self.config.robot {
            if stamp.incarnation > self.own {
                self.outgrow(stamp.incarnation);
            }
            return;
        }
        let admission = self.admit(&stamp.robot, stamp.incarnation);
        let Some(seat) = admission.seat() else { return };
        let said_at = self.said_at(Duration::from_millis(stamp.age_ms));
        self.hear(seat, stamp.heartbeat, said_at);
        if stamp.sequence > self.authors.at(seat).sequence() {
            self.repair.want(seat, self.clock);
        }
        if let Some(address) = stamp.address.filter(|_| self.liveness.is_living(seat)) {
            self.peers.suppose(seat, address);
        }
    }

    /// When news of this age was said; what waited for this robot's pause may be older.
    pub(super) fn said_at(&self, age: Duration) -> Instant {
        let late = if self.clock <= self.late_until { self.late_by } else { Duration::ZERO };
        self.clock - age.saturating_add(late)
    }

    /// Who is known of the ids in question, with where they were heard.
    pub(super) fn stamps_for(&self, ids: impl Iterator<Item = Seat>) -> Vec<Section> {
        let stamps: Vec<Stamp> = ids.filter_map(|seat| self.stamp(seat)).collect();
        stamps.chunks(STAMPS_PER_SECTION).map(|some| Section::Stamps(some.to_vec())).collect()
    }

    /// Tells a robot that speaks under an old incarnation how far it was known.
    pub(super) fn correct(&mut self, to: SocketAddr, seat: Seat) {
        if self.repair.may_correct(self.clock) {
            let sections = self.stamps_for(core::iter::once(seat));
            self.send(to, sections);
        }
    }
}

/// Stamps that fit one datagram: at most 99 bytes each, about 35 in practice.
const STAMPS_PER_SECTION: usize = 10;
