//! A drawn run in two phases: safety at every step while faults last, then everything must
//! come right within a bound.

use std::{
    panic::{AssertUnwindSafe, catch_unwind},
    time::Duration,
};

use super::{Fleet, Record, Scenario, Violation, check::convergence, run::Run, story};

/// After the last fault everything must be right within this: a robot is found gone in 10 s,
/// a plan that failed is asked again after at most 10 s, a move prepares for at most 30 s.
pub const CONVERGED_WITHIN: Duration = Duration::from_secs(60);
/// And must stay so.
const STAYS: Duration = Duration::from_secs(2);
const PACE: Duration = Duration::from_millis(500);

/// What came of a drawn run.
#[derive(Debug, Clone)]
pub struct Outcome {
    /// What was measured.
    pub record: Record,
    /// What happened, a line each; empty unless asked for.
    pub story: Vec<String>,
}

impl Outcome {
    /// The first rule that was broken.
    pub fn violation(&self) -> Option<&Violation> {
        self.record.violations.first()
    }
}

/// Whether the story is kept.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Telling {
    /// Figures only.
    Silent,
    /// Every line.
    Whole,
}

impl Scenario {
    /// Runs it until the first rule is broken, or to its end.
    pub fn run(&self, telling: Telling) -> Outcome {
        let mut setup = self.setup();
        setup.keeps_events = telling == Telling::Whole;
        let mut fleet = Fleet::new(setup);
        fleet.place(self.places.clone());
        for incident in &self.incidents {
            fleet.schedule(incident);
        }
        let mut run = Run::new(fleet, self.seed);
        run.stops_early = true;
        // a brain that panics must not end the other seeds
        let ended = catch_unwind(AssertUnwindSafe(|| self.phases(&mut run)));
        if let Err(panic) = ended {
            let text = panic.downcast_ref::<String>().cloned();
            let text = text.or_else(|| panic.downcast_ref::<&str>().map(ToString::to_string));
            run.note("panic", text.unwrap_or_default());
        }
        let story = match telling {
            Telling::Silent => Vec::new(),
            Telling::Whole => story(&run.fleet),
        };
        Outcome { record: run.finish(), story }
    }

    fn phases(&self, run: &mut Run) {
        for robot in 0..self.robots {
            run.fleet.switch_on(robot);
            run.advance(Duration::from_millis(70));
        }
        let rest = (super::fleet::BEGIN + self.calm_after).since(run.fleet.now);
        run.advance(rest);
        if run.is_over() {
            return;
        }
        run.fleet.calm();
        let right = |fleet: &Fleet| convergence::lacking(fleet).is_none();
        let end = run.fleet.now + CONVERGED_WITHIN;
        while run.fleet.now < end && !run.is_over() {
            let left = end.since(run.fleet.now);
            if !run.advance_until(left, PACE, right) {
                break;
            }
            run.advance(STAYS);
            if right(&run.fleet) {
                return;
            }
        }
        if let Some(lacking) = convergence::lacking(&run.fleet).filter(|_| !run.is_over()) {
            run.note("not-converged", lacking);
        }
    }
}
