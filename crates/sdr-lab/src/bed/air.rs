//! The radio between the robots: who hears a frame, and when.
//!
//! One cell behind one access point. A frame goes up from its sender and down to its receivers,
//! over one medium that all share. To one receiver a try that fails is repeated; to all (DDS
//! discovery) it goes down once, at the slowest rate, and whoever misses it has missed it.

use std::{collections::VecDeque, time::Duration};

use serde::Serialize;

use super::{
    frame::Receiver,
    link::{Link, LinkChange},
    modulation::Sending,
};
use crate::sim::Chance;

/// Tries of a frame to one receiver.
const TRIES_MAX: u32 = 7;
/// Frames of one turn (A-MPDU).
const TURN_FRAMES_MAX: u32 = 32;
/// Preamble, spaces between frames and the acknowledgement.
const OVERHEAD: Duration = Duration::from_micros(100);
/// Bytes that 802.11 adds to a frame of Ethernet.
const HEADER_BYTES: usize = 36;
/// What a frame to all is sent with, unless the link has a stated rate.
const SLOWEST_BITS_PER_SECOND: f64 = 6.5e6;
/// One slot of the back-off.
const SLOT: Duration = Duration::from_micros(9);
/// Slots of the first back-off and of the longest.
const SLOTS: (u32, u32) = (15, 1023);

/// Which way a robot is cut off.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Deaf {
    /// It hears nothing and is not heard.
    Both,
    /// It is not heard, but hears.
    Out,
    /// It hears nothing, but is heard.
    In,
}

/// What became of a robot's frames.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize)]
pub struct Traffic {
    /// Frames sent to one receiver.
    pub unicast_frames: u64,
    /// Their bytes.
    pub unicast_bytes: u64,
    /// Frames sent to all.
    pub multicast_frames: u64,
    /// Their bytes.
    pub multicast_bytes: u64,
    /// Frames delivered to this robot.
    pub received_frames: u64,
    /// Frames for this robot or from it that the radio lost.
    pub lost_frames: u64,
    /// Frames from this robot that found the queue full.
    pub queue_dropped_frames: u64,
}

/// A frame that has reached the access point.
#[derive(Clone, Copy, Debug)]
struct Sent {
    at: Duration,
    from: usize,
    bytes: usize,
    all: bool,
    /// It did not find the air free.
    waited: bool,
}

/// Frames of one link that go in one turn: the back-off and the preamble are paid once.
#[derive(Clone, Copy, Debug, Default)]
struct Turn {
    robot: Option<usize>,
    frames: u32,
}

impl Turn {
    /// Whether a frame of this link begins a new turn. One that `waited` behind others of the same
    /// link goes with them, as long as the turn is not too long.
    fn begins(&mut self, robot: usize, waited: bool) -> bool {
        let goes_on = waited && self.robot == Some(robot) && self.frames < TURN_FRAMES_MAX;
        self.frames = if goes_on { self.frames + 1 } else { 1 };
        self.robot = Some(robot);
        !goes_on
    }
}

/// See the module.
#[derive(Debug)]
pub struct Air {
    links: Vec<Link>,
    deaf: Vec<Option<Deaf>>,
    /// Sides that do not hear each other, by name.
    walls: Vec<(String, Vec<bool>)>,
    waiting: Vec<VecDeque<(Duration, usize)>>,
    last_arrival: Vec<Vec<Duration>>,
    free_at: Duration,
    /// Frames that go up, and down, in one turn.
    turns: (Turn, Turn),
    traffic: Vec<Traffic>,
    chance: Chance,
}

impl Air {
    /// A good radio for so many robots.
    pub fn new(robots: usize, seed: u64) -> Self {
        let links = (1..).take(robots).map(|number| Link::new(seed, number)).collect();
        Self {
            links,
            deaf: vec![None; robots],
            walls: Vec::new(),
            waiting: vec![VecDeque::new(); robots],
            last_arrival: vec![vec![Duration::ZERO; robots]; robots],
            free_at: Duration::ZERO,
            turns: (Turn::default(), Turn::default()),
            traffic: vec![Traffic::default(); robots],
            chance: Chance::stream(seed, 0),
        }
    }

    /// Changes a robot's link.
    pub fn change(&mut self, now: Duration, robot: usize, change: &LinkChange) {
        self.links[robot].change(now, change);
    }

    /// Moves a robot, in metres from the access point; from then on its level follows from that.
    pub fn place(&mut self, now: Duration, robot: usize, to: (f64, f64), over: Duration) {
        self.links[robot].place(now, to, over);
    }

    /// Cuts a robot off, or lets it hear again.
    pub fn deafen(&mut self, robot: usize, deaf: Option<Deaf>) {
        self.deaf[robot] = deaf;
    }

    /// Splits the robots: those inside and those outside do not hear each other.
    pub fn split(&mut self, name: &str, inside: Vec<bool>) {
        self.heal(name);
        self.walls.push((name.to_owned(), inside));
    }

    /// Takes a split away.
    pub fn heal(&mut self, name: &str) {
        self.walls.retain(|(other, _)| other != name);
    }

    /// Where a robot is, metres.
    pub fn position(&self, now: Duration, robot: usize) -> (f64, f64) {
        self.links[robot].position(now)
    }

    /// Mean level of a robot's link; `None` out of reach.
    pub fn level_dbm(&self, now: Duration, robot: usize) -> Option<f64> {
        self.links[robot].mean_dbm(now)
    }

    /// What a robot's driver shows; `None` while it has no access point.
    pub(super) fn shown_dbm(&mut self, now: Duration, robot: usize) -> Option<f64> {
        let shown = self.links[robot].shown_dbm(now);
        shown.filter(|_| self.deaf[robot].is_none())
    }

    /// What became of all frames, by robot.
    pub fn traffic(&self) -> &[Traffic] {
        &self.traffic
    }

    /// Who gets the frame, and when.
    pub(super) fn send(
        &mut self,
        now: Duration,
        from: usize,
        to: Receiver,
        bytes: usize,
    ) -> Vec<(usize, Duration)> {
        let all = to == Receiver::All;
        let traffic = &mut self.traffic[from];
        let (frames, sum) = match all {
            true => (&mut traffic.multicast_frames, &mut traffic.multicast_bytes),
            false => (&mut traffic.unicast_frames, &mut traffic.unicast_bytes),
        };
        *frames += 1;
        *sum += bytes as u64;
        let receivers: Vec<usize> = match to {
            Receiver::One(robot) => vec![robot],
            Receiver::All => (0..self.links.len()).filter(|robot| *robot != from).collect(),
        };
        if receivers.iter().any(|robot| *robot >= self.links.len()) {
            return Vec::new();
        }
        let waited = self.free_at > now;
        if !self.finds_room(now, from, bytes) {
            self.traffic[from].queue_dropped_frames += 1;
            return Vec::new();
        }
        let up = self.links[from].sending(now, bytes, false);
        let up = up.filter(|_| !matches!(self.deaf[from], Some(Deaf::Both | Deaf::Out)));
        let first = self.turns.0.begins(from, waited);
        let sent_at = self.transmit(now, up, bytes, first);
        let done = self.free_at;
        self.waiting[from].push_back((done, bytes));
        let Some(sent_at) = sent_at else {
            self.traffic[from].lost_frames += 1;
            return Vec::new();
        };
        let mut arrivals = Vec::new();
        for robot in receivers {
            match self.receive(&Sent { at: sent_at, from, bytes, all, waited }, robot) {
                Some(at) => {
                    self.traffic[robot].received_frames += 1;
                    arrivals.push((robot, at));
                }
                None => self.traffic[robot].lost_frames += 1,
            }
        }
        if all {
            // One frame goes down for all of them.
            self.free_at = self.free_at.max(sent_at) + airtime(bytes, SLOWEST_BITS_PER_SECOND);
        }
        arrivals
    }

    /// The way down from the access point.
    fn receive(&mut self, sent: &Sent, to: usize) -> Option<Duration> {
        let Sent { at: sent_at, from, bytes, all, waited } = *sent;
        let down = self.links[to].sending(sent_at, bytes, all);
        let hears = !matches!(self.deaf[to], Some(Deaf::Both | Deaf::In));
        let apart = self.walls.iter().any(|(_, inside)| inside[from] != inside[to]);
        let down = down.filter(|_| hears && !apart);
        let at = if all {
            // Whoever misses the only try has missed it.
            let down = down.filter(|sending| !self.chance.happens(sending.try_loss))?;
            sent_at + airtime(bytes, down.bits_per_second)
        } else {
            let first = self.turns.1.begins(to, waited);
            self.transmit(sent_at, down, bytes, first)?
        };
        if self.links[from].swallows(at) | self.links[to].swallows(at) {
            return None;
        }
        let at = at + self.links[from].added() + self.links[to].added();
        // A link keeps its order.
        let last = &mut self.last_arrival[from][to];
        *last = at.max(*last);
        Some(*last)
    }

    /// Tries until it is heard or too often; when it is over, `None` when in vain.
    fn transmit(
        &mut self,
        now: Duration,
        sending: Option<Sending>,
        bytes: usize,
        first: bool,
    ) -> Option<Duration> {
        // Without an access point nothing is sent and no air is taken.
        let way = sending?;
        let mut at = self.free_at.max(now);
        let mut slots = SLOTS.0;
        let mut heard = false;
        for number in 0..TRIES_MAX {
            let airtime = airtime(bytes, way.bits_per_second);
            if first || number > 0 {
                at += SLOT.mul_f64(self.chance.uniform() * f64::from(slots)) + airtime;
            } else {
                at += airtime - OVERHEAD;
            }
            slots = (2 * slots + 1).min(SLOTS.1);
            if !self.chance.happens(way.try_loss) {
                heard = true;
                break;
            }
        }
        self.free_at = at;
        heard.then_some(at)
    }

    /// Whether the sender's queue has room.
    fn finds_room(&mut self, now: Duration, from: usize, bytes: usize) -> bool {
        let waiting = &mut self.waiting[from];
        while waiting.front().is_some_and(|(done, _)| *done <= now) {
            waiting.pop_front();
        }
        let sum: usize = waiting.iter().map(|(_, bytes)| bytes).sum();
        sum + bytes <= self.links[from].queue_bytes
    }
}

/// How long one try takes the medium.
#[expect(clippy::cast_precision_loss, reason = "a frame's length")]
fn airtime(bytes: usize, bits_per_second: f64) -> Duration {
    let bits = 8.0 * (bytes + HEADER_BYTES) as f64;
    OVERHEAD + Duration::from_secs_f64(bits / bits_per_second.max(1000.0))
}

#[cfg(test)]
mod tests;
