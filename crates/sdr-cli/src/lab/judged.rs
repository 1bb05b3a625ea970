//! Expectations while the scenario runs: open, met, or missed.

use std::time::Duration;

use sdr_files::{
    Scenario,
    scenario::{Action, Choice, Expectation, Step, Wanted, When},
};
use serde::{Deserialize, Serialize};

use super::{
    eyes::Seen,
    judge::{Bench, Found},
};

/// What became of one expectation.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub(crate) struct Verdict {
    /// Its line in the scenario.
    pub(crate) line: u32,
    /// What was expected.
    pub(crate) expected: String,
    /// Whether it came true.
    pub(crate) met: bool,
    /// From the step until it was true, or was not any more, ms.
    pub(crate) took_ms: Option<f64>,
    /// What was found.
    pub(crate) found: String,
}

/// One that is not decided yet.
struct Open<'a> {
    step: &'a Step,
    expectation: &'a Expectation,
    since_ns: u64,
    last: String,
}

/// All of them.
#[derive(Default)]
pub(super) struct Judged<'a> {
    open: Vec<Open<'a>>,
    /// Those that the recordings will tell.
    pub(super) at_end: Vec<(&'a Step, &'a Expectation, u64)>,
    pub(super) verdicts: Vec<Verdict>,
}

impl<'a> Judged<'a> {
    /// An expectation begins to count.
    pub(super) fn begin(&mut self, step: &'a Step, now_ns: u64) {
        let Action::Expect(expectation) = &step.what else { return };
        match expectation.what {
            Wanted::Lost(..) | Wanted::Pause(..) => self.at_end.push((step, expectation, now_ns)),
            Wanted::Home(..)
            | Wanted::State(..)
            | Wanted::Coordinator(..)
            | Wanted::Coordinators(_)
            | Wanted::Seen(..)
            | Wanted::Running
            | Wanted::Unchanged
            | Wanted::Event(_) => {
                let last = "nobody answered".to_owned();
                self.open.push(Open { step, expectation, since_ns: now_ns, last });
            }
        }
    }

    /// Looks at all that are open; new verdicts are given.
    pub(super) fn look(&mut self, scenario: &Scenario, seen: &Seen, now: Duration) -> Vec<Verdict> {
        let mut decided = Vec::new();
        self.open.retain_mut(|open| {
            let bench = Bench { scenario, seen, since_ns: open.since_ns };
            let found = bench.judge(open.expectation);
            let after = now.saturating_sub(open.step.at);
            match decide(open, found, after) {
                None => true,
                Some(met) => {
                    let took = Some(after).filter(|_| met != is_lasting(open.expectation));
                    decided.push(Verdict {
                        line: open.step.line,
                        expected: words(open.expectation),
                        met,
                        took_ms: took.map(|took| crate::report::summary::ms(nanoseconds(took))),
                        found: open.last.clone(),
                    });
                    false
                }
            }
        });
        self.verdicts.extend(decided.iter().cloned());
        decided
    }

    /// Whether nothing is open.
    pub(super) fn is_done(&self) -> bool {
        self.open.is_empty()
    }
}

fn is_lasting(expectation: &Expectation) -> bool {
    matches!(expectation.when, When::Lasting(_))
}

/// Whether it is met, when that can be said.
fn decide(open: &mut Open<'_>, found: Found, after: Duration) -> Option<bool> {
    let (is, told) = match found {
        Found::True(words) => (Some(true), Some(words)),
        Found::False(words) => (Some(false), Some(words)),
        Found::Unknown => (None, None),
    };
    if let Some(told) = told {
        open.last = told;
    }
    match open.expectation.when {
        When::Within(_) if is == Some(true) => Some(true),
        When::Within(limit) => (after >= limit).then_some(false),
        When::Lasting(_) if is == Some(false) => Some(false),
        When::Lasting(limit) => (after >= limit).then_some(true),
    }
}

fn nanoseconds(time: Duration) -> u64 {
    u64::try_from(time.as_nanos()).unwrap_or(u64::MAX)
}

/// The expectation in words.
pub(super) fn words(expectation: &Expectation) -> String {
    let robot = |choice: &Choice| match choice {
        Choice::Is(robot) => robot.to_string(),
        Choice::IsNot(robot) => format!("any but {robot}"),
    };
    let what = match &expectation.what {
        Wanted::Home(component, choice) => format!("{component} active at {}", robot(choice)),
        Wanted::State(component, Some(state)) => format!("{component} {state:?}").to_lowercase(),
        Wanted::State(component, None) => format!("{component} in no state"),
        Wanted::Coordinator(choice) => format!("coordinator {}", robot(choice)),
        Wanted::Coordinators(count) => format!("{count} hold the coordinator role"),
        Wanted::Seen(robot, true) => format!("{robot} seen alive"),
        Wanted::Seen(robot, false) => format!("{robot} taken for gone"),
        Wanted::Running => "all active and heard".to_owned(),
        Wanted::Unchanged => "no process starts or ends, nothing moves".to_owned(),
        Wanted::Event(event) => {
            let about =
                event.component.as_ref().map(|name| format!(" of {name}")).unwrap_or_default();
            let by = event.robot.as_ref().map(|robot| format!(" by {robot}")).unwrap_or_default();
            let most = event.at_most.map(|most| format!(", at most {most}")).unwrap_or_default();
            format!("event {}{about}{by} at least {}{most}", event.kind, event.at_least)
        }
        Wanted::Lost(connection, most) => format!("at most {most} samples lost on {connection}"),
        Wanted::Pause(connection, most) => format!("no pause of {connection} over {most:?}"),
    };
    let seen = expectation.seen_from.as_ref().map(|robot| format!(", seen from {robot}"));
    let when = match (&expectation.what, expectation.when) {
        (Wanted::Lost(..) | Wanted::Pause(..), _) => String::new(),
        (_, When::Within(time)) => format!(" within {time:?}"),
        (_, When::Lasting(time)) => format!(" for {time:?}"),
    };
    format!("{what}{when}{}", seen.unwrap_or_default())
}
