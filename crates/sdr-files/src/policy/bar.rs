//! Bars and release levels in the unit of their fact.

use std::time::Duration;

use sdr_core::recover::Cause;
use sdr_recovery::{Bar, Clear, Condition, Fact, Level, PER_MAX, Unit};

use super::{condition_words::ClearText, recovery_file::RuleChanges};
use crate::{
    problem::Mark,
    read::{At, Reader},
    units::{self, UnitError},
};

/// The bar of a rule, and the time in which is counted.
pub(super) fn bar(
    cause: &At<Cause>,
    fact: Fact,
    changes: &RuleChanges,
    before: Option<Condition>,
    reader: &mut Reader,
) -> Option<(Bar, Duration)> {
    match (&changes.at_most, &changes.at_least, before) {
        (Some(text), None, _) => {
            let (level, per) = level(text, &text.value.0, fact, reader)?;
            if fact.unit() == Unit::Rate {
                let message = format!("{} at most so often is no fault", fact.word());
                reader.problem(text.mark, message, Some(String::from("allowed: at_least")));
            }
            Some((Bar::AtMost(level), per))
        }
        (None, Some(text), _) => {
            let (level, per) = level(text, &text.value.0, fact, reader)?;
            Some((Bar::AtLeast(level), per))
        }
        (None, None, Some(before)) => Some((before.bar, before.per)),
        (Some(_), Some(second), _) => {
            let message = "both `at_most` and `at_least`";
            reader.problem(second.mark, message, Some(String::from("allowed: one of them")));
            None
        }
        (None, None, None) => {
            let message = format!("{} has no bar", cause.value);
            let help = format!("allowed: at_most or at_least with {}", fact.unit().example());
            reader.problem(cause.mark, message, Some(help));
            None
        }
    }
}

pub(super) fn clear(
    at: &At<ClearText>,
    fact: Fact,
    bar: Bar,
    per: Duration,
    reader: &mut Reader,
) -> Option<Clear> {
    let level = if fact.unit() == Unit::Rate {
        released_rate(at, per, reader)?
    } else {
        level(at, &at.value.level, fact, reader)?.0
    };
    check_outside(level, bar, at.mark, reader);
    Some(Clear { level, hold: at.value.hold })
}

/// `1`, or `1 per 1min` where that is the time of the bar.
fn released_rate(at: &At<ClearText>, per: Duration, reader: &mut Reader) -> Option<Level> {
    let text = at.value.level.as_str();
    let found = match text.split_once(" per ") {
        None => text.trim().parse().ok(),
        Some(_) => rate(text).ok().filter(|(_, found)| *found == per).map(|(count, _)| count),
    };
    if found.is_none() {
        let help = format!("allowed: a number, in the time of the bar ({per:?})");
        reader.problem(at.mark, format!("found `{text}`"), Some(help));
    }
    found.map(Level::Count)
}

/// How long an expression or a program must say otherwise: `clear: 5s`.
pub(super) fn release_time(at: &At<ClearText>, reader: &mut Reader) -> Option<Duration> {
    let found = units::duration(&at.value.level).ok().filter(|_| at.value.hold.is_zero());
    if found.is_none() {
        let message = "what is told has no level";
        let help = String::from("allowed: how long it must be over, such as `clear: 5s`");
        reader.problem(at.mark, message, Some(help));
    }
    found
}

/// A release level on the bad side of the bar would flap.
pub(super) fn check_outside(clear: Level, bar: Bar, mark: Mark, reader: &mut Reader) {
    let (inside, side) = match bar {
        Bar::AtMost(level) => (below(clear, level), "or more"),
        Bar::AtLeast(level) => (below(level, clear), "or less"),
    };
    if inside {
        let message = format!("clear at {clear} is inside the fault");
        reader.problem(mark, message, Some(format!("allowed: {} {side}", bar.level())));
    }
}

fn below(a: Level, b: Level) -> bool {
    match (a, b) {
        (Level::Memory(a), Level::Memory(b)) => a < b,
        (Level::Share(a), Level::Share(b)) => a < b,
        (Level::Signal(a), Level::Signal(b)) => a < b,
        (Level::Time(a), Level::Time(b)) => a < b,
        (Level::Count(a), Level::Count(b)) => a < b,
        (Level::Flag(a), Level::Flag(b)) => !a && b,
        (
            Level::Memory(_)
            | Level::Share(_)
            | Level::Signal(_)
            | Level::Time(_)
            | Level::Count(_)
            | Level::Flag(_),
            _,
        ) => false,
    }
}

/// `text` in the unit of `fact`, and the time in which is counted.
fn level<T>(at: &At<T>, text: &str, fact: Fact, reader: &mut Reader) -> Option<(Level, Duration)> {
    let plain = |level: Result<Level, UnitError>| {
        level.map(|level| (level, Duration::ZERO)).map_err(|error| error.to_string())
    };
    let parsed = match fact.unit() {
        Unit::Memory => plain(units::size(text).map(Level::Memory)),
        Unit::Share => plain(units::share(text).map(Level::Share)),
        Unit::Signal => plain(units::level(text).map(Level::Signal)),
        Unit::Time => plain(units::duration(text).map(Level::Time)),
        Unit::Rate => rate(text).map(|(count, per)| (Level::Count(count), per)),
        Unit::Flag => Err(format!("found `{text}`")),
    };
    parsed
        .map_err(|error| {
            let help = format!("allowed: {} is {}", fact.word(), fact.unit().example());
            reader.problem(at.mark, error, Some(help));
        })
        .ok()
}

/// `3 per 1min`.
fn rate(text: &str) -> Result<(u32, Duration), String> {
    let refused = || format!("found `{text}`");
    let (count, per) = text.split_once(" per ").ok_or_else(refused)?;
    let count: u32 = count.trim().parse().map_err(|_| refused())?;
    let per = per.trim();
    // `3 per min`, as people say it.
    let bare = per.starts_with(|first: char| first.is_ascii_alphabetic());
    let time = if bare { units::duration(&format!("1{per}")) } else { units::duration(per) };
    let per = time.map_err(|error| error.to_string())?;
    if count == 0 || per.is_zero() || per > PER_MAX {
        return Err(format!("found `{text}`: at least 1, per at most {PER_MAX:?}"));
    }
    Ok((count, per))
}
