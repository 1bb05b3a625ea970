//! Round trips of every pair that talks: RTT, jitter, loss.

use alloc::{
    collections::{BTreeMap, VecDeque},
    vec::Vec,
};
use core::{net::SocketAddr, time::Duration};

use crate::{id::RobotId, report::LinkReport, time::Instant, units::Permille};

/// Round trips kept for the median.
const SAMPLES: usize = 16;
/// Outcomes kept for the loss.
const OUTCOMES: usize = 64;
/// A ping without an answer for so long is lost.
const LOST_AFTER: Duration = Duration::from_secs(1);
/// Pings under way at once; the oldest is given up beyond it.
const PENDING_MAX: usize = 256;

#[derive(Clone, Debug, Default)]
struct Link {
    round_trips: VecDeque<Duration>,
    jitter: Duration,
    answered: VecDeque<bool>,
}

/// Links of this robot.
#[derive(Clone, Debug, Default)]
pub(super) struct Links {
    links: BTreeMap<RobotId, Link>,
    robots: BTreeMap<SocketAddr, RobotId>,
    pending: BTreeMap<u16, (SocketAddr, Instant)>,
    number: u16,
}

impl Links {
    /// The number for a ping to `to`, sent now.
    pub(super) fn ping(&mut self, to: SocketAddr, now: Instant) -> u16 {
        self.give_up(now);
        self.number = self.number.wrapping_add(1);
        self.pending.insert(self.number, (to, now));
        self.number
    }

    /// An answer of `robot` to ping `number`; false for one that is not awaited.
    pub(super) fn pong(&mut self, robot: &RobotId, number: u16, now: Instant) -> bool {
        let Some((to, sent_at)) = self.pending.remove(&number) else { return false };
        self.robots.insert(to, robot.clone());
        let link = self.links.entry(robot.clone()).or_default();
        let round_trip = now.since(sent_at);
        if let Some(before) = link.round_trips.back() {
            // RFC 3550, 6.4.1: J += (|D| - J) / 16
            let change = round_trip.abs_diff(*before);
            link.jitter = link.jitter - link.jitter / 16 + change / 16;
        }
        push(&mut link.round_trips, round_trip, SAMPLES);
        push(&mut link.answered, true, OUTCOMES);
        true
    }

    /// This robot was deaf: what is under way proves nothing.
    pub(super) fn forgive(&mut self) {
        self.pending.clear();
    }

    pub(super) fn reports(&self) -> impl Iterator<Item = (&RobotId, LinkReport)> {
        self.links.iter().map(|(robot, link)| (robot, link.report()))
    }

    fn give_up(&mut self, now: Instant) {
        let lost: Vec<u16> = self
            .pending
            .iter()
            .filter(|(_, (_, sent_at))| now.since(*sent_at) >= LOST_AFTER)
            .map(|(number, _)| *number)
            .collect();
        for number in lost {
            let Some((to, _)) = self.pending.remove(&number) else { continue };
            let Some(robot) = self.robots.get(&to) else { continue };
            if let Some(link) = self.links.get_mut(robot) {
                push(&mut link.answered, false, OUTCOMES);
            }
        }
        while self.pending.len() >= PENDING_MAX {
            self.pending.pop_first();
        }
    }
}

impl Link {
    fn report(&self) -> LinkReport {
        let mut sorted: Vec<Duration> = self.round_trips.iter().copied().collect();
        sorted.sort_unstable();
        let lost = self.answered.iter().filter(|answered| !**answered).count();
        let permille = lost * 1000 / self.answered.len().max(1);
        LinkReport {
            rtt: sorted.get(sorted.len() / 2).copied().unwrap_or_default(),
            jitter: self.jitter,
            loss: Permille(u32::try_from(permille).unwrap_or(1000)),
        }
    }
}

fn push<T>(queue: &mut VecDeque<T>, value: T, max: usize) {
    if queue.len() >= max {
        queue.pop_front();
    }
    queue.push_back(value);
}
