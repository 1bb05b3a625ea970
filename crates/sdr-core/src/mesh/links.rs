//! Round trips, jitter and loss of every pair that talks, from numbers that ride on
//! whatever is sent anyway.

use alloc::collections::{BTreeMap, VecDeque};
use core::time::Duration;

use super::{
    author_table::Seat,
    wire::{Echo, LinkMark},
};
use crate::{report::LinkReport, time::Instant, units::Permille};

/// Round trips kept for the median.
const SAMPLES: usize = 16;
/// Datagrams that the loss is taken over.
const WINDOW: u16 = 64;
/// Sent datagrams whose moment is remembered.
const SENT_MAX: usize = 32;
/// A datagram that nobody echoed for so long is lost, when later ones are missing too.
const LOST_AFTER: Duration = Duration::from_secs(2);
/// A link is silent after so many of its usual gaps.
const SILENT_GAPS: u32 = 6;
/// Datagrams without any echo that make the way out a dead one.
const UNECHOED_MAX: usize = 4;

#[derive(Clone, Debug, Default)]
struct Link {
    round_trips: VecDeque<Duration>,
    jitter: Duration,
    /// The number of the last datagram sent, and when the last ones were.
    number: u16,
    sent: VecDeque<(u16, Instant)>,
    /// The last number that came, when, and which of the 64 up to it did.
    came: Option<(u16, Instant)>,
    /// Usual time from one to the next; zero when unknown.
    gap: Duration,
    came_bits: u64,
    came_count: u16,
    /// What the other end says of the way out.
    loss_out: Option<u8>,
    echoed: Option<(u16, Instant)>,
}

/// Links of this robot, by the other robot's seat.
#[derive(Clone, Debug, Default)]
pub(super) struct Links {
    links: BTreeMap<Seat, Link>,
}

impl Links {
    /// Numbers a datagram to `to`, sent now.
    pub(super) fn mark(&mut self, to: Seat, now: Instant) -> LinkMark {
        let link = self.links.entry(to).or_default();
        link.number = link.number.wrapping_add(1);
        if link.sent.len() >= SENT_MAX {
            link.sent.pop_front();
        }
        link.sent.push_back((link.number, now));
        let echo = link.came.map(|(number, at)| Echo {
            number,
            held: u32::try_from(now.since(at).as_micros() / 100).unwrap_or(u32::MAX),
            loss: u8::try_from(u32::from(link.lost_in()) * 255 / 1000).unwrap_or(255),
        });
        LinkMark { number: link.number, echo }
    }

    /// The mark of a datagram that came from `from`.
    pub(super) fn take(&mut self, from: Seat, mark: LinkMark, now: Instant) {
        let link = self.links.entry(from).or_default();
        link.take_number(mark.number, now);
        if let Some(echo) = mark.echo {
            link.take_echo(echo, now);
        }
    }

    /// Whether `seat` said that it heard this robot.
    pub(super) fn is_echoed(&self, seat: Seat) -> bool {
        self.links.get(&seat).is_some_and(|link| link.echoed.is_some())
    }

    /// This robot was paused or deaf: what is under way proves nothing.
    pub(super) fn forgive(&mut self) {
        for link in self.links.values_mut() {
            link.sent.clear();
        }
    }

    /// The robot starts its numbers anew.
    pub(super) fn reset(&mut self, seat: Seat) {
        self.links.remove(&seat);
    }

    /// What was measured so far; a robot that lives and was not heard directly for
    /// `silent_after`, and for much longer than usual, has a way in that loses everything.
    pub(super) fn reports(
        &self,
        now: Instant,
        silent_after: Duration,
    ) -> impl Iterator<Item = (Seat, LinkReport)> {
        let known = self.links.iter().filter(|(_, link)| link.came.is_some());
        known.map(move |(seat, link)| (*seat, link.report(now, silent_after)))
    }

    /// How far the loss of a link differs by chance from one count to the next.
    pub(super) fn noise(&self, seat: Seat) -> Permille {
        self.links.get(&seat).map_or(Permille(1000), Link::noise)
    }

    /// The loss on the way from one robot alone.
    pub(super) fn loss_in(
        &self,
        seat: Seat,
        now: Instant,
        silent_after: Duration,
    ) -> Option<Permille> {
        let link = self.links.get(&seat).filter(|link| link.came.is_some())?;
        Some(link.loss(now, silent_after).2)
    }

    /// Robots that were heard.
    pub(super) fn heard(&self) -> impl Iterator<Item = Seat> {
        let known = self.links.iter().filter(|(_, link)| link.came.is_some());
        known.map(|(seat, _)| *seat)
    }

    /// The same of one robot.
    pub(super) fn report(
        &self,
        seat: Seat,
        now: Instant,
        silent_after: Duration,
    ) -> Option<LinkReport> {
        let link = self.links.get(&seat).filter(|link| link.came.is_some())?;
        Some(link.report(now, silent_after))
    }
}

impl Link {
    fn take_number(&mut self, number: u16, now: Instant) {
        let ahead = self.came.map_or(1, |(last, _)| number.wrapping_sub(last));
        let behind = ahead.wrapping_neg();
        if ahead != 0 && ahead < u16::MAX / 2 {
            if let Some((_, before)) = self.came {
                let gap = now.since(before);
                let mean = self.gap - self.gap / 8 + gap / 8;
                self.gap = if self.gap.is_zero() { gap } else { mean };
            }
            let shifted = u32::from(ahead);
            self.came_bits = self.came_bits.checked_shl(shifted).unwrap_or(0) | 1;
            self.came_count = self.came_count.saturating_add(ahead).min(WINDOW);
            self.came = Some((number, now));
        } else if behind < WINDOW {
            self.came_bits |= 1 << behind;
        }
    }

    fn take_echo(&mut self, echo: Echo, now: Instant) {
        let older = self.echoed.is_some_and(|(last, _)| {
            let ahead = echo.number.wrapping_sub(last);
            ahead == 0 || ahead > u16::MAX / 2
        });
        self.loss_out = Some(echo.loss);
        if older {
            return;
        }
        self.echoed = Some((echo.number, now));
        let Some((_, sent_at)) = self.sent.iter().find(|(number, _)| *number == echo.number) else {
            return;
        };
        let held = Duration::from_micros(u64::from(echo.held) * 100);
        let Some(round_trip) = now.since(*sent_at).checked_sub(held) else { return };
        if let Some(before) = self.round_trips.back() {
            // RFC 3550, 6.4.1: J += (|D| - J) / 16
            let change = round_trip.abs_diff(*before);
            self.jitter = self.jitter - self.jitter / 16 + change / 16;
        }
        if self.round_trips.len() >= SAMPLES {
            self.round_trips.pop_front();
        }
        self.round_trips.push_back(round_trip);
    }

    /// Lost datagrams of the last ones that should have come, thousandths.
    fn lost_in(&self) -> u16 {
        let window = self.came_count.max(1);
        let mask = if window >= WINDOW { u64::MAX } else { (1 << window) - 1 };
        let came = u16::try_from((self.came_bits & mask).count_ones()).unwrap_or(WINDOW);
        window.saturating_sub(came) * 1000 / window
    }

    /// Lost datagrams of the last ones sent, thousandths: what the other end counts, and
    /// all that were sent since it echoed one.
    fn lost_out(&self, now: Instant) -> u32 {
        let since = self.echoed.map_or(0, |(number, _)| number);
        let unanswered = self.sent.iter().filter(|(number, at)| {
            let ahead = number.wrapping_sub(since);
            ahead != 0 && ahead < u16::MAX / 2 && now.since(*at) > LOST_AFTER
        });
        let unanswered = unanswered.count();
        let silent = self.echoed.is_none_or(|(_, at)| {
            self.came.is_some_and(|(_, came_at)| came_at.since(at) > LOST_AFTER)
        });
        if silent && unanswered >= UNECHOED_MAX {
            return 1000;
        }
        self.loss_out.map_or(0, |loss| u32::from(loss) * 1000 / 255)
    }

    /// The standard deviation of the loss there and back, were both ways alike; wide while
    /// little was counted.
    fn noise(&self) -> Permille {
        let count = u32::from(self.came_count.max(1));
        let lost = u32::from(self.lost_in()) * count;
        let share = (lost + 1000) / (count + 2);
        let variance = share * 1000u32.saturating_sub(share) / count;
        Permille((2 * variance).isqrt())
    }

    /// Loss there or back, out, and in.
    fn loss(&self, now: Instant, silent_after: Duration) -> (Permille, Permille, Permille) {
        let silent_after = silent_after.max(self.gap * SILENT_GAPS);
        let silent = self.came.is_some_and(|(_, at)| now.since(at) > silent_after);
        let loss_in = if silent { 1000 } else { u32::from(self.lost_in()) };
        let loss_out = self.lost_out(now);
        let both = 1000 - (1000 - loss_in) * (1000 - loss_out) / 1000;
        (Permille(both), Permille(loss_out), Permille(loss_in))
    }

    fn report(&self, now: Instant, silent_after: Duration) -> LinkReport {
        let mut sorted = [Duration::ZERO; SAMPLES];
        let sorted = &mut sorted[..self.round_trips.len().min(SAMPLES)];
        sorted.iter_mut().zip(&self.round_trips).for_each(|(to, from)| *to = *from);
        sorted.sort_unstable();
        let (loss, loss_out, loss_in) = self.loss(now, silent_after);
        LinkReport {
            rtt: sorted.get(sorted.len() / 2).copied().unwrap_or_default(),
            jitter: self.jitter,
            loss,
            loss_out,
            loss_in,
        }
    }
}
