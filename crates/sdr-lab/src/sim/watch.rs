//! Those who only watch: each holds one rule and says when it is broken.

use serde::Serialize;

use super::{Fleet, Sight, check};

/// A rule that was broken.
#[derive(Debug, Clone, PartialEq, Eq, Serialize)]
pub struct Violation {
    /// The seed of the run.
    pub seed: u64,
    /// How many things had been done.
    pub step: u64,
    /// Which rule, such as `token-decreased`.
    pub rule: String,
    /// Virtual milliseconds since the beginning.
    pub at_ms: u64,
    /// What was seen.
    pub what: String,
}

/// A rule that was broken, as a checker sees it.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Broken {
    /// Which rule.
    pub rule: &'static str,
    /// What was seen.
    pub what: String,
}

impl Broken {
    /// `rule` was broken: `what`.
    pub fn new(rule: &'static str, what: impl Into<String>) -> Self {
        Self { rule, what: what.into() }
    }
}

/// Watches a fleet and never touches it.
pub trait Checker {
    /// Takes one sight in; says what it breaks.
    fn watch(&mut self, fleet: &Fleet, sight: &Sight) -> Option<Broken>;
}

/// All checkers together.
pub struct Watch {
    checkers: Vec<Box<dyn Checker>>,
    /// What was found, at most one for each rule.
    pub violations: Vec<Violation>,
    seed: u64,
}

impl Watch {
    /// All rules.
    pub fn new(seed: u64) -> Self {
        Self { checkers: check::all(), violations: Vec::new(), seed }
    }

    /// Shows `sight` to everybody.
    pub fn show(&mut self, fleet: &Fleet, sight: &Sight) {
        for checker in &mut self.checkers {
            if let Some(broken) = checker.watch(fleet, sight) {
                note(&mut self.violations, self.seed, fleet, &broken);
            }
        }
    }

    /// Notes a rule that somebody else saw broken.
    pub fn note(&mut self, fleet: &Fleet, broken: &Broken) {
        note(&mut self.violations, self.seed, fleet, broken);
    }
}

fn note(violations: &mut Vec<Violation>, seed: u64, fleet: &Fleet, broken: &Broken) {
    if violations.iter().any(|known| known.rule == broken.rule) {
        return;
    }
    violations.push(Violation {
        seed,
        step: fleet.steps(),
        rule: broken.rule.into(),
        at_ms: u64::try_from(fleet.age().as_millis()).unwrap_or(u64::MAX),
        what: broken.what.clone(),
    });
}
