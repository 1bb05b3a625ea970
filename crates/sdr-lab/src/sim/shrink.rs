//! Makes a failing run smaller: fewer incidents, fairer weather, while the same rule breaks.

use super::{Scenario, Weather, chaos::Telling};

/// Runs tried at most.
const TRIES_MAX: usize = 400;

/// A smaller scenario that breaks the same rule.
#[derive(Debug, Clone)]
pub struct Shrunk {
    /// The scenario.
    pub scenario: Scenario,
    /// Its incidents by their place in the whole list, from 1.
    pub numbers: Vec<usize>,
    /// Whether the radio of the smaller one is fair and its clocks perfect.
    pub fair: bool,
    /// Runs tried.
    pub tries: usize,
}

/// Removes what `rule` does not need to break.
pub fn shrink(whole: &Scenario, rule: &str) -> Shrunk {
    let mut tries = 0;
    let mut breaks = |scenario: &Scenario| {
        tries += 1;
        let outcome = scenario.run(Telling::Silent);
        tries <= TRIES_MAX && outcome.violation().is_some_and(|found| found.rule == rule)
    };
    let fair = breaks(&fair_weather(whole));
    let base = if fair { fair_weather(whole) } else { whole.clone() };
    let mut numbers: Vec<usize> = (1..=whole.incidents.len()).collect();
    let mut chunk = numbers.len().div_ceil(2);
    while chunk > 0 {
        let mut begin = 0;
        while begin < numbers.len() {
            let end = (begin + chunk).min(numbers.len());
            let fewer: Vec<usize> = [&numbers[..begin], &numbers[end..]].concat();
            if breaks(&base.only(&fewer)) {
                numbers = fewer;
            } else {
                begin = end;
            }
        }
        chunk = if chunk == 1 { 0 } else { chunk.div_ceil(2) };
    }
    Shrunk { scenario: base.only(&numbers), numbers, fair, tries }
}

/// The same with a fair radio and perfect clocks.
pub fn fair_weather(scenario: &Scenario) -> Scenario {
    Scenario { weather: Weather::fair(), places: Vec::new(), drift_ppm_max: 0, ..scenario.clone() }
}
