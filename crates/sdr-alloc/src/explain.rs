//! Reasons for people: the number and the bar of everything that was refused.

use alloc::{
    format,
    string::{String, ToString},
    vec::Vec,
};
use core::{fmt, time::Duration};

use sdr_core::{
    allocate::{Homeless, Placement, Refusal, Tier},
    id::Name,
    units::{Bytes, Permille},
};

use crate::feasible::{Failure, LinkBar, Question};

/// What stands where nobody can tell.
const UNKNOWN: &str = "unknown";

/// The failure of `question` in words.
pub(crate) fn refusal(question: Question<'_>, failure: &Failure<'_>) -> Refusal {
    let (constraint, found, bar) = words(question, failure);
    let robot = question.facts.robots[question.robot].robot.clone();
    Refusal { robot, constraint: constraint.to_string(), found, bar }
}

/// One line for a component that found a home:
/// `exploration/camera to robot-2, 1370 MB left; robot-1: memory_free 310 MB, bar 500 MB`.
pub fn placement_line(placement: &Placement) -> String {
    let tier = match placement.tier {
        Tier::Strict => "",
        Tier::Relaxed => ", relaxed tier",
    };
    let Placement { component, robot, memory_left, refusals, .. } = placement;
    let line = format!("{component} to {robot}, {memory_left} left{tier}");
    with_refusals(line, refusals)
}

/// One line for a component that found none.
pub fn homeless_line(homeless: &Homeless) -> String {
    with_refusals(format!("{} has no home", homeless.component), &homeless.refusals)
}

fn with_refusals(mut line: String, refusals: &[Refusal]) -> String {
    for refusal in refusals {
        line.push_str("; ");
        line.push_str(&refusal.to_string());
    }
    line
}

fn words(question: Question<'_>, failure: &Failure<'_>) -> (&'static str, String, String) {
    let item = &question.facts.problem.items[question.item];
    let robots = &question.facts.robots;
    let offer = robots[question.robot];
    match failure {
        Failure::Avoid(reason) => ("avoid", (*reason).to_string(), "a robot without that".into()),
        Failure::Pinned => {
            let wanted = item.place.robot.as_ref().or(item.component.scope.as_ref());
            let wanted = wanted.map_or(String::new(), ToString::to_string);
            ("place", offer.robot.to_string(), wanted)
        }
        Failure::Labels => ("labels", list(&offer.labels), list(&item.place.labels)),
        Failure::Devices => ("devices", list(&offer.devices), list(&item.devices)),
        Failure::Launch => {
            ("launch", "not installed".into(), format!("what launches {}", item.component.name))
        }
        Failure::ApartFrom(other) => ("apart_from", beside(other), format!("no {other}")),
        Failure::TogetherWith(other, home) => {
            ("together_with", format!("{other} on {}", robots[*home].robot), beside(other))
        }
        Failure::Memory(left) => {
            let bar = question.bars.memory_free_at_least.unwrap_or(Bytes(0));
            ("memory_free", signed_bytes(*left), bar.to_string())
        }
        Failure::Cpu(used) => {
            let used = u32::try_from(*used).unwrap_or(u32::MAX);
            ("cpu_used", Permille(used).to_string(), text(question.bars.cpu_used_at_most))
        }
        Failure::Battery(bar) => {
            let charge = question.facts.battery(question.robot);
            ("battery", text(charge), bar.at_least.to_string())
        }
        Failure::Link(bar, far) => link_words(question, *bar, *far),
    }
}

fn link_words(question: Question<'_>, bar: LinkBar, far: usize) -> (&'static str, String, String) {
    let link = question.facts.link(question.robot, far);
    let bars = question.bars;
    let millis = |time: Option<Duration>| text(time.map(Millis));
    let (constraint, found, bar) = match bar {
        LinkBar::Rssi => ("rssi", text(link.rssi), text(bars.rssi_at_least)),
        LinkBar::Jitter => ("jitter", millis(link.jitter), millis(bars.jitter_at_most)),
        LinkBar::Distance => ("distance", text(link.distance), text(bars.distance_at_most)),
        LinkBar::Delay => ("delay", millis(link.delay), millis(bars.delay_at_most)),
        LinkBar::Loss => ("loss", text(link.loss), text(bars.loss_at_most)),
    };
    (constraint, format!("{found} to {}", question.facts.robots[far].robot), bar)
}

fn beside(other: &Name) -> String {
    format!("{other} here")
}

fn text<T: fmt::Display>(value: Option<T>) -> String {
    value.map_or_else(|| UNKNOWN.to_string(), |value| value.to_string())
}

fn list<T: ToString>(words: &[T]) -> String {
    if words.is_empty() {
        return "none".into();
    }
    words.iter().map(ToString::to_string).collect::<Vec<_>>().join(", ")
}

fn signed_bytes(left: i128) -> String {
    let size = Bytes(u64::try_from(left.unsigned_abs()).unwrap_or(u64::MAX));
    if left < 0 { format!("-{size}") } else { size.to_string() }
}

/// A time as milliseconds with one decimal.
struct Millis(Duration);

impl fmt::Display for Millis {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let micros = self.0.as_micros();
        write!(f, "{}.{} ms", micros / 1000, micros / 100 % 10)
    }
}
