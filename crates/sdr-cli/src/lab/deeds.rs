//! From a scenario's words to the bed's.

use std::time::Duration;

use sdr_files::scenario::{Action, Blow, Cut, LinkSettings, Target};
use sdr_lab::bed::{Bursts, Deaf, LinkChange, Signal};

/// What is stated of a link.
pub(super) fn link_change(settings: &LinkSettings) -> LinkChange {
    let share = |permille: sdr_core::units::Permille| f64::from(permille.0) / 1000.0;
    LinkChange {
        level: settings.level.map(|level| (f64::from(level.tenths()) / 10.0, settings.over)),
        loss: settings.loss.map(share),
        try_loss: settings.try_loss.map(share),
        bursts: settings.bursts.map(|bursts| Bursts {
            loss: share(bursts.loss),
            every: bursts.every,
            lasting: bursts.lasting,
        }),
        delay: settings.delay,
        jitter: settings.jitter,
        #[expect(clippy::cast_precision_loss, reason = "at most 10^10")]
        rate: settings.rate.map(|rate| rate as f64),
        queue_bytes: settings.queue.map(|queue| usize::try_from(queue.0).unwrap_or(usize::MAX)),
        corners: settings.corners.map(f64::from),
    }
}

pub(super) fn deaf(cut: Cut) -> Deaf {
    match cut {
        Cut::Both => Deaf::Both,
        Cut::Out => Deaf::Out,
        Cut::In => Deaf::In,
    }
}

pub(super) fn signal(blow: Blow) -> Signal {
    match blow {
        Blow::Kill => Signal::KILL,
        Blow::Term => Signal::TERM,
        Blow::Stop => Signal::STOP,
        Blow::Continue => Signal::CONT,
    }
}

/// One line that tells what happens.
pub(super) fn words(action: &Action) -> String {
    let list = |robots: &[sdr_core::id::RobotId]| {
        robots.iter().map(ToString::to_string).collect::<Vec<_>>().join(", ")
    };
    let lasting =
        |time: &Option<Duration>| time.map(|time| format!(" for {time:?}")).unwrap_or_default();
    match action {
        Action::Link(robots, settings) => {
            format!("link of {}: {}", list(robots), link_words(settings))
        }
        Action::Move(robot, place, over) => {
            let metres = |mm: i32| f64::from(mm) / 1000.0;
            format!(
                "{robot} goes to {:.1}, {:.1} m within {over:?}",
                metres(place.x_mm),
                metres(place.y_mm)
            )
        }
        Action::Outage(robots, cut, time) => {
            let way = match cut {
                Cut::Both => "deaf and mute",
                Cut::Out => "mute",
                Cut::In => "deaf",
            };
            format!("{} {way}{}", list(robots), lasting(time))
        }
        Action::Split(name, robots, time) => {
            format!("{name}: {} cut off from the others{}", list(robots), lasting(time))
        }
        Action::Heal(name) => format!("{name} is over"),
        Action::Battery(robot, to, over) => {
            format!("battery of {robot} goes to {}% within {over:?}", f64::from(to.0) / 10.0)
        }
        Action::Memory(robot, bytes) => {
            format!("other programs of {robot} leave {} MB", bytes.0 / 1_000_000)
        }
        Action::Cpu(robot, used) => {
            format!("other programs of {robot} use {}% of a core", used.0 / 10)
        }
        Action::Signal(target, blow) => format!("{blow:?} {}", target_words(target)).to_lowercase(),
        Action::Start(robot) => format!("agent of {robot} is started again"),
        Action::Power(robots, time) => format!("{} without power{}", list(robots), lasting(time)),
        Action::PowerOn(robots) => format!("{} has power again", list(robots)),
        Action::DiskFull(robot, true) => format!("disk of {robot} is full"),
        Action::DiskFull(robot, false) => format!("disk of {robot} has room again"),
        Action::DiskSlow(robot, delay) => format!("disk of {robot} takes {delay:?} for each write"),
        Action::Faulty(component, _, order) => format!("{component} is told: {order}"),
        Action::Sdr { robot, words, fails } => {
            let fails = if *fails { ", which must fail" } else { "" };
            format!("operator at {robot}: sdr {}{fails}", words.join(" "))
        }
        Action::Expect(_) => "an expectation".to_owned(),
    }
}

fn target_words(target: &Target) -> String {
    match target {
        Target::Agent(robot) => format!("the agent of {robot}"),
        Target::Component(name, Some(robot)) => format!("{name} on {robot}"),
        Target::Component(name, None) => name.clone(),
    }
}

fn link_words(settings: &LinkSettings) -> String {
    let percent = |share: sdr_core::units::Permille| format!("{}%", f64::from(share.0) / 10.0);
    let words = [
        settings
            .level
            .map(|level| format!("level {:.1} dBm within {:?}", level.as_f64(), settings.over)),
        settings.loss.map(|loss| format!("loss {}", percent(loss))),
        settings.try_loss.map(|loss| format!("tries lost {}", percent(loss))),
        settings.bursts.map(|bursts| {
            format!(
                "bursts of {} for {:?} every {:?}",
                percent(bursts.loss),
                bursts.lasting,
                bursts.every
            )
        }),
        settings.delay.map(|delay| format!("delay {delay:?}")),
        settings.jitter.map(|jitter| format!("jitter {jitter:?}")),
        settings.rate.map(|rate| format!("rate {} kbit/s", rate / 1000)),
        settings.queue.map(|queue| format!("queue {} B", queue.0)),
        settings.corners.map(|corners| format!("{corners} corners")),
    ];
    words.into_iter().flatten().collect::<Vec<_>>().join(", ")
}
