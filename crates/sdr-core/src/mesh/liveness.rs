//! Who is alive: each observer's own judgement from the age of fresh news on any path.
//!
//! News is as old as the moment at which its robot said it, not as its arrival, so that all
//! observers judge at nearly the same moment.

use alloc::vec::Vec;
use core::time::Duration;

use super::author_table::Seat;
use crate::time::Instant;

/// Quiet begins at this share of the age at which a robot is gone: 2.8 s of 11.5 s.
const QUIET_SHARE: (u32, u32) = (28, 115);
/// A robot that heard nobody for this share of that age is deaf: 3.45 s of 11.5 s.
const DEAF_SHARE: (u32, u32) = (3, 10);
/// After hearing nobody for this share of it, 1.5 s of 11.5 s, it judges nobody further.
const DOUBT_SHARE: (u32, u32) = (13, 100);
/// Robots are judged at most so often.
const JUDGE_STEP: Duration = Duration::from_millis(50);
/// Weight of the past in the usual gap, samples.
const GAPS_KEPT: u64 = 1024;
/// Quiet begins after so many times the age of the gone at the latest.
const QUIET_MAX: u32 = 10;

/// One observer's judgement of one robot.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord)]
pub enum Standing {
    /// No news since this robot's start.
    #[default]
    Unheard,
    /// No fresh news for too long.
    Gone,
    /// No fresh news for longer than usual; it is being asked.
    Quiet,
    /// Fresh news arrives.
    Alive,
}

/// What is known of one robot's life.
#[derive(Clone, Copy, Debug)]
pub(super) struct Seen {
    /// Milliseconds of its own clock at its last news.
    pub(super) heartbeat: u64,
    /// When it said that, on this robot's clock.
    pub(super) fresh_at: Instant,
    /// When it was last heard without a relay.
    pub(super) direct_at: Option<Instant>,
    /// When it was last asked for a sign of life.
    pub(super) pinged_at: Instant,
    /// How often its news was passed on since it advanced.
    pub(super) told: u8,
    pub(super) standing: Standing,
}

/// What a sign of life changed.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Heard {
    /// Nothing: it was known.
    Nothing,
    /// A greater heartbeat.
    Advance,
    /// A greater heartbeat of a robot that was not alive.
    Return,
}

/// Ages of the last fresh news of all other robots, by seat.
#[derive(Clone, Debug)]
pub(super) struct Liveness {
    gone_after: Duration,
    period: Duration,
    seen: Vec<Seen>,
    living: usize,
    /// Grows when a robot begins or ceases to live.
    edition: u64,
    /// Mean and mean deviation of how old news is when fresher comes, microseconds.
    gap_mean: u64,
    gap_deviation: u64,
    gaps_count: u64,
    judge_at: Option<Instant>,
    heard_at: Instant,
    isolated: bool,
    /// Others were heard lately that know other robots: news passes by ids until then.
    by_ids_until: Instant,
    by_ids: bool,
    /// Worked out once for each size of the fleet: asked for with every sign of life.
    passage: Duration,
    quiet_base: Duration,
}

impl Liveness {
    pub(super) fn new(gone_after: Duration, period: Duration, now: Instant) -> Self {
        Self {
            gone_after,
            period,
            seen: Vec::new(),
            living: 0,
            edition: 0,
            gap_mean: 0,
            gap_deviation: 0,
            gaps_count: 0,
            judge_at: None,
            heard_at: now,
            isolated: false,
            by_ids_until: now,
            by_ids: false,
            passage: Duration::ZERO,
            quiet_base: gone_after * QUIET_SHARE.0 / QUIET_SHARE.1,
        }
    }

    /// Somebody was heard that knows other robots by name: fewer are told in one datagram,
    /// and news takes longer. It does so until the last of it has passed.
    pub(super) fn note_other_names(&mut self, now: Instant) {
        if !self.by_ids {
            self.by_ids = true;
            self.refit();
        }
        self.by_ids_until = now + self.passage;
    }

    /// Makes a seat's robot unheard, be it new or another incarnation.
    pub(super) fn reset(&mut self, seat: Seat) {
        let unheard = Seen {
            heartbeat: 0,
            fresh_at: Instant::ZERO,
            direct_at: None,
            pinged_at: Instant::ZERO,
            told: 0,
            standing: Standing::Unheard,
        };
        while self.seen.len() <= seat.index() {
            self.seen.push(unheard);
        }
        // a robot that starts anew does not die by it
        let before = self.seen[seat.index()];
        self.seen[seat.index()] = match before.standing {
            Standing::Alive | Standing::Quiet => Seen { heartbeat: 0, told: 0, ..before },
            Standing::Gone | Standing::Unheard => unheard,
        };
    }

    /// News that a robot said at `said_at`.
    pub(super) fn hear(
        &mut self,
        seat: Seat,
        heartbeat: u64,
        said_at: Instant,
        now: Instant,
    ) -> Heard {
        if self.seen.get(seat.index()).is_none_or(|seen| heartbeat <= seen.heartbeat) {
            return Heard::Nothing;
        }
        let (quiet_after, gone_after) = (self.quiet(), self.gone());
        let Some(seen) = self.seen.get_mut(seat.index()) else { return Heard::Nothing };
        let gap = now.since(seen.fresh_at);
        seen.heartbeat = heartbeat;
        seen.told = 0;
        seen.fresh_at = seen.fresh_at.max(said_at.min(now));
        let age = now.since(seen.fresh_at);
        match (seen.standing, age < gone_after) {
            (Standing::Alive | Standing::Quiet, _) => {
                // late news of a robot that is quiet since is no sign of life
                let quiet_at = seen.fresh_at + quiet_after;
                if age < quiet_after && seen.standing == Standing::Quiet {
                    seen.standing = Standing::Alive;
                    self.wake_at(quiet_at, now);
                }
                self.note_gap(gap);
                Heard::Advance
            }
            (Standing::Gone | Standing::Unheard, true) => {
                seen.standing = Standing::Alive;
                let quiet_at = seen.fresh_at + quiet_after;
                self.living += 1;
                self.edition += 1;
                self.wake_at(quiet_at, now);
                self.refit();
                Heard::Return
            }
            (Standing::Unheard | Standing::Gone, false) => {
                seen.standing = Standing::Gone;
                Heard::Nothing
            }
        }
    }

    /// A datagram of the robot itself came; how long this robot heard nobody before, when
    /// that makes it deaf.
    pub(super) fn hear_directly(&mut self, seat: Seat, now: Instant) -> Option<Duration> {
        if let Some(seen) = self.seen.get_mut(seat.index()) {
            seen.direct_at = Some(now);
        }
        let silence = now.since(self.heard_at);
        self.heard_at = now;
        (silence > self.deaf_after()).then_some(silence)
    }

    /// Robots whose standing falls at `now`.
    pub(super) fn judge(&mut self, now: Instant) -> Vec<(Seat, Standing)> {
        if self.by_ids && now >= self.by_ids_until {
            self.by_ids = false;
            self.refit();
        }
        if self.judge_at.is_none_or(|at| now < at) {
            return Vec::new();
        }
        let mut fallen = Vec::new();
        let mut next: Option<Instant> = None;
        let (quiet, gone) = (self.quiet(), self.gone());
        let judged_at = self.clock(now);
        for (index, seen) in self.seen.iter_mut().enumerate() {
            let age = judged_at.since(seen.fresh_at);
            let due = match seen.standing {
                Standing::Unheard | Standing::Gone => continue,
                Standing::Alive if age < quiet => seen.fresh_at + quiet,
                Standing::Alive => {
                    seen.standing = Standing::Quiet;
                    fallen.push((Seat::at(index), Standing::Quiet));
                    seen.fresh_at + gone
                }
                Standing::Quiet if age < gone => seen.fresh_at + gone,
                Standing::Quiet => {
                    seen.standing = Standing::Gone;
                    self.living -= 1;
                    self.edition += 1;
                    fallen.push((Seat::at(index), Standing::Gone));
                    continue;
                }
            };
            next = Some(next.map_or(due, |next| next.min(due)));
        }
        self.judge_at = next.map(|at| at.max(now + JUDGE_STEP));
        if !fallen.is_empty() {
            self.refit();
        }
        fallen
    }

    /// Whether this robot just became one that hears nobody.
    pub(super) fn becomes_isolated(&mut self, now: Instant) -> bool {
        let begins = !self.isolated && self.living > 0 && self.is_deaf(now);
        self.isolated |= begins;
        begins
    }

    /// Whether this robot just ceased to be one that hears nobody.
    pub(super) fn rejoins(&mut self) -> bool {
        core::mem::take(&mut self.isolated)
    }

    /// News could not be heard for `pause`: no age grows by it.
    pub(super) fn forgive(&mut self, pause: Duration, now: Instant) {
        for seen in &mut self.seen {
            seen.fresh_at = (seen.fresh_at + pause).min(now);
        }
    }

    /// This robot itself did nothing for `pause`.
    pub(super) fn forgive_pause(&mut self, pause: Duration, now: Instant) {
        self.forgive(pause, now);
        self.heard_at = (self.heard_at + pause).min(now);
    }

    pub(super) fn is_isolated(&self) -> bool {
        self.isolated
    }

    /// How long nobody was heard.
    pub(super) fn silence(&self, now: Instant) -> Duration {
        now.since(self.heard_at)
    }

    pub(super) fn get(&self, seat: Seat) -> Option<&Seen> {
        self.seen.get(seat.index())
    }

    pub(super) fn get_mut(&mut self, seat: Seat) -> Option<&mut Seen> {
        self.seen.get_mut(seat.index())
    }

    pub(super) fn standing(&self, seat: Seat) -> Standing {
        self.get(seat).map_or(Standing::Unheard, |seen| seen.standing)
    }

    pub(super) fn is_living(&self, seat: Seat) -> bool {
        matches!(self.standing(seat), Standing::Alive | Standing::Quiet)
    }

    /// All others with their seats, the own seat left out.
    pub(super) fn all(&self) -> impl Iterator<Item = (Seat, &Seen)> {
        let seen = self.seen.iter().enumerate();
        seen.map(|(index, seen)| (Seat::at(index), seen)).filter(|(seat, _)| *seat != Seat::OWN)
    }

    /// Others that are alive or quiet.
    pub(super) fn living(&self) -> impl Iterator<Item = (Seat, &Seen)> {
        self.all().filter(|(_, seen)| matches!(seen.standing, Standing::Alive | Standing::Quiet))
    }

    /// How many others are alive or quiet.
    pub(super) fn living_count(&self) -> usize {
        self.living
    }

    pub(super) fn edition(&self) -> u64 {
        self.edition
    }

    pub(super) fn next_deadline(&self) -> Option<Instant> {
        let deaf_at = (!self.isolated && self.living > 0)
            .then(|| self.heard_at + self.deaf_after() + Duration::from_nanos(1));
        self.judge_at.into_iter().chain(deaf_at).min()
    }

    /// The age at which a robot is quiet: as configured, or longer where news usually takes
    /// longer, by what was measured and by how long news takes through a fleet of this size.
    pub(super) fn quiet(&self) -> Duration {
        let usual = Duration::from_micros(self.gap_deviation * 9 / 2).max(self.passage);
        usual.max(self.quiet_base).min(self.gone_after * QUIET_MAX)
    }

    /// The size of the fleet changed, or how its news passes.
    fn refit(&mut self) {
        self.passage = self.passage();
    }

    /// Time in which nearly all news goes through the fleet: where each datagram tells of
    /// all, the rounds in which it doubles and half as many; else eight turns of the beats.
    fn passage(&self) -> Duration {
        let round = super::round::period(self.period, self.living);
        let told = match self.by_ids {
            true => super::round::beats_by_id(self.living),
            false => super::round::beats_in_round(self.living),
        };
        if told >= self.living {
            let doublings = usize::BITS - self.living.leading_zeros();
            return round * doublings * 3 / 2;
        }
        let ratio = |count: usize| u32::try_from(count).unwrap_or(u32::MAX);
        round * 8 * ratio(self.living) / ratio(told).max(1)
    }

    /// The age at which a robot is gone: later by half as much again as quiet is. In between
    /// it is asked directly.
    pub(super) fn gone(&self) -> Duration {
        let stretched = self.quiet() - self.quiet_base;
        self.gone_after + stretched + stretched / 2
    }

    fn deaf_after(&self) -> Duration {
        self.gone_after * DEAF_SHARE.0 / DEAF_SHARE.1
    }

    fn doubt_after(&self) -> Duration {
        self.gone_after * DOUBT_SHARE.0 / DOUBT_SHARE.1
    }

    fn is_deaf(&self, now: Instant) -> bool {
        now.since(self.heard_at) > self.deaf_after()
    }

    /// The moment to judge by: the clock of a robot that may be deaf stands until twice the
    /// age of the gone has passed, unless there is only one robot to hear.
    fn clock(&self, now: Instant) -> Instant {
        let silence = now.since(self.heard_at);
        match self.living {
            0 | 1 => now,
            _ if silence < self.gone() * 2 => now.min(self.heard_at + self.doubt_after()),
            _ => now,
        }
    }

    fn note_gap(&mut self, gap: Duration) {
        let gap = micros(gap);
        self.gaps_count = (self.gaps_count + 1).min(GAPS_KEPT);
        let towards =
            |mean: u64, sample: u64| mean - mean / self.gaps_count + sample / self.gaps_count;
        self.gap_mean = towards(self.gap_mean, gap);
        self.gap_deviation = towards(self.gap_deviation, gap.abs_diff(self.gap_mean));
    }

    fn wake_at(&mut self, at: Instant, now: Instant) {
        let at = at.max(now);
        self.judge_at = Some(self.judge_at.map_or(at, |before| before.min(at)));
    }
}

fn micros(duration: Duration) -> u64 {
    u64::try_from(duration.as_micros()).unwrap_or(u64::MAX)
}
