//! One run: a fleet, those who watch it, those who measure it.

use std::time::{Duration, Instant as RealInstant};

use sdr_core::time::Instant;

use super::{Broken, Fleet, Record, Sight, Watch, measure::Measure};

/// A look after so many steps at the latest: a fleet that floods itself gets no further in
/// time.
const LOOK_STEPS: u64 = 50_000;

/// A fleet under watch.
pub(crate) struct Run {
    pub(crate) fleet: Fleet,
    pub(crate) watch: Watch,
    pub(crate) measure: Measure,
    /// Stops at the first rule that is broken.
    pub(crate) stops_early: bool,
    look_at: Instant,
    look_period: Duration,
    looked_after: u64,
    real: RealInstant,
    on_s: f64,
    counted_at: Instant,
    begun_at: Instant,
}

impl Run {
    pub(crate) fn new(fleet: Fleet, seed: u64) -> Self {
        let look_period = match fleet.robots.len() {
            0..=50 => Duration::from_millis(500),
            51..=200 => Duration::from_secs(1),
            _ => Duration::from_secs(5),
        };
        Self {
            look_at: fleet.now + look_period,
            look_period,
            looked_after: 0,
            counted_at: fleet.now,
            begun_at: fleet.now,
            fleet,
            stops_early: false,
            watch: Watch::new(seed),
            measure: Measure::default(),
            real: RealInstant::now(),
            on_s: 0.0,
        }
    }

    /// Lets time pass under everybody's eyes.
    pub(crate) fn advance(&mut self, time: Duration) {
        let end = self.fleet.now + time;
        loop {
            let until = end.min(self.look_at);
            while self.fleet.step(until) {
                if self.fleet.has_sights() {
                    self.show();
                }
                if self.fleet.steps() >= self.looked_after + LOOK_STEPS {
                    self.look();
                }
                if self.is_over() {
                    return;
                }
            }
            if self.fleet.now >= self.look_at {
                self.look_at = self.fleet.now + self.look_period;
                self.look();
            }
            if self.fleet.now >= end || self.is_over() {
                return;
            }
        }
    }

    /// Whether it stops here because a rule is broken.
    pub(crate) fn is_over(&self) -> bool {
        self.stops_early && !self.watch.violations.is_empty()
    }

    /// Lets time pass until `done`; false when `limit` passed first.
    pub(crate) fn advance_until(
        &mut self,
        limit: Duration,
        pace: Duration,
        mut done: impl FnMut(&Fleet) -> bool,
    ) -> bool {
        let end = self.fleet.now + limit;
        while !done(&self.fleet) {
            if self.fleet.now >= end || self.is_over() {
                return false;
            }
            self.advance(pace);
        }
        true
    }

    pub(crate) fn note(&mut self, rule: &'static str, what: String) {
        self.watch.note(&self.fleet, &Broken::new(rule, what));
    }

    pub(crate) fn finish(mut self) -> Record {
        self.count_hours();
        let mut record = self.measure.record;
        record.virtual_s = self.fleet.now.since(self.begun_at).as_secs_f64();
        record.real_s = self.real.elapsed().as_secs_f64();
        record.robot_hours = self.on_s / 3600.0;
        record.replans = self.fleet.tally.replans;
        record.handled = self.fleet.tally.handled;
        record.trace_hash = self.fleet.trace_hash();
        record.violations = self.watch.violations;
        record
    }

    fn show(&mut self) {
        for sight in self.fleet.take_sights() {
            self.watch.show(&self.fleet, &sight);
            self.measure.see(&self.fleet, &sight);
        }
    }

    fn look(&mut self) {
        self.looked_after = self.fleet.steps();
        self.count_hours();
        self.watch.show(&self.fleet, &Sight::Look);
        self.measure.see(&self.fleet, &Sight::Look);
    }

    fn count_hours(&mut self) {
        let on = self.fleet.robots.iter().filter(|robot| robot.is_on()).count();
        self.on_s += on as f64 * self.fleet.now.since(self.counted_at).as_secs_f64();
        self.counted_at = self.fleet.now;
    }
}
