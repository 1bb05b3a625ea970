//! Steps: a time and exactly one thing.

use std::time::Duration;

use sdr_core::{id::Name, units::Permille};

use super::{
    check::Context,
    expect,
    file::{DiskTable, FaultyTable, LinkTable, SdrTable, SignalTable, StepTable},
    types::{Action, Blow, Cut, Step, Target},
};
use crate::read::At;

/// Slowest write to a platter.
const SLOWEST: Duration = Duration::from_secs(10);
/// Most CPU that other programs use: 64 cores.
const CPU_MAX: Permille = Permille(64_000);

/// The step, when it is one.
pub(super) fn checked(entry: &At<StepTable>, context: &mut Context<'_>) -> Option<Step> {
    let table = &entry.value;
    let at = context.time(&table.at, Duration::ZERO);
    let mut found = Vec::new();
    let mut add = |one: Option<Option<Action>>| found.extend(one);
    add(table.link.as_ref().map(|one| link(one, context)));
    add(table.r#move.as_ref().map(|one| {
        let robot = context.robot(&one.value.robot)?;
        let over = one.value.over.as_ref().map(|at| context.time(at, Duration::ZERO));
        Some(Action::Move(robot, one.value.to.value, over.unwrap_or_default()))
    }));
    add(table.outage.as_ref().map(|one| {
        let robots = context.all(&one.value.robots);
        let way = one.value.way.as_ref().map_or(Cut::Both, |at| at.value);
        Some(Action::Outage(robots, way, lasting(one.value.lasting.as_ref(), context)))
    }));
    add(table.split.as_ref().map(|one| {
        let inside = context.all(&one.value.inside);
        let name =
            one.value.name.as_ref().map_or_else(|| "split".to_owned(), |at| at.value.clone());
        Some(Action::Split(name, inside, lasting(one.value.lasting.as_ref(), context)))
    }));
    add(table.heal.as_ref().map(|one| Some(Action::Heal(one.value.clone()))));
    add(table.battery.as_ref().map(|one| {
        let robot = context.robot(&one.value.robot)?;
        let over = one.value.over.as_ref().map(|at| context.time(at, Duration::ZERO));
        Some(Action::Battery(robot, context.share(&one.value.to), over.unwrap_or_default()))
    }));
    add(table.memory.as_ref().map(|one| {
        Some(Action::Memory(context.robot(&one.value.robot)?, one.value.available.value))
    }));
    add(table.cpu.as_ref().map(|one| {
        let used = one.value.used.value;
        if used > CPU_MAX {
            let help = Some("allowed: 0% to 6400%".to_owned());
            context.reader.problem(one.value.used.mark, "more than 64 cores", help);
        }
        Some(Action::Cpu(context.robot(&one.value.robot)?, used))
    }));
    add(table.signal.as_ref().map(|one| signal(one, context)));
    add(table.start.as_ref().map(|one| context.robot(one).map(Action::Start)));
    add(table.power_off.as_ref().map(|one| {
        let robots = context.all(&one.value.robots);
        Some(Action::Power(robots, lasting(one.value.back_after.as_ref(), context)))
    }));
    add(table.power_on.as_ref().map(|one| Some(Action::PowerOn(context.all(one)))));
    add(table.disk.as_ref().map(|one| disk(one, context)));
    add(table.faulty.as_ref().map(|one| faulty(&one.value, context)));
    add(table.sdr.as_ref().map(|one| sdr(&one.value, context)));
    add(table
        .expect
        .as_ref()
        .map(|one| expect::checked(one, context).map(|wanted| Action::Expect(Box::new(wanted)))));
    if found.len() != 1 {
        if context.reader.has_told(entry.mark.line) {
            return None;
        }
        let message = format!("a step with {} things that happen", found.len());
        let help = "allowed: `at` and exactly one of link, move, outage, split, heal, battery, memory, \
                    cpu, signal, start, power_off, power_on, disk, faulty, sdr, expect";
        context.reader.problem(entry.mark, message, Some(help.to_owned()));
        return None;
    }
    let what = found.into_iter().next().flatten()?;
    Some(Step { at, line: entry.mark.line, what })
}

fn lasting(at: Option<&At<Duration>>, context: &mut Context<'_>) -> Option<Duration> {
    at.map(|at| context.time(at, Duration::from_millis(1)))
}

fn link(at: &At<LinkTable>, context: &mut Context<'_>) -> Option<Action> {
    let settings = Box::new(context.link(&at.value));
    let Some(robots) = &at.value.robots else {
        context.reader.problem(at.mark, "key `robots` is missing", None);
        return None;
    };
    Some(Action::Link(context.all(robots), settings))
}

fn signal(at: &At<SignalTable>, context: &mut Context<'_>) -> Option<Action> {
    let table = &at.value;
    let blow = table.send.as_ref().map_or(Blow::Kill, |at| at.value);
    let on = table.robot.as_ref().map(|at| context.robot(at));
    let target = match (&table.agent, &table.component, on) {
        (Some(agent), None, None) => Target::Agent(context.robot(agent)?),
        (None, Some(component), on) => Target::Component(component.value.to_string(), on.flatten()),
        (Some(_), _, _) | (None, None, _) => {
            let help = "allowed: { agent: ROBOT } or { component: NAME, robot: ROBOT }".to_owned();
            context.reader.problem(at.mark, "it is not clear who gets the signal", Some(help));
            return None;
        }
    };
    Some(Action::Signal(target, blow))
}

fn disk(at: &At<DiskTable>, context: &mut Context<'_>) -> Option<Action> {
    let robot = context.robot(&at.value.robot)?;
    match (&at.value.full, &at.value.delay) {
        (Some(full), None) => Some(Action::DiskFull(robot, full.value)),
        (None, Some(delay)) => {
            if delay.value > SLOWEST {
                let help = Some(format!("allowed: 0s to {SLOWEST:?}"));
                context.reader.problem(delay.mark, format!("{:?}", delay.value), help);
            }
            Some(Action::DiskSlow(robot, delay.value))
        }
        (Some(_), Some(_)) | (None, None) => {
            let help = Some("allowed: `full` or `delay`".to_owned());
            context.reader.problem(at.mark, "it is not clear what happens to the disk", help);
            None
        }
    }
}

fn faulty(table: &FaultyTable, context: &mut Context<'_>) -> Option<Action> {
    let robot = match &table.robot {
        Some(robot) => Some(context.robot(robot)?),
        None => None,
    };
    let component: &Name = &table.component.value;
    Some(Action::Faulty(component.to_string(), robot, table.order.value.clone()))
}

fn sdr(table: &SdrTable, context: &mut Context<'_>) -> Option<Action> {
    let robot = context.robot(&table.robot)?;
    let mut words = Vec::new();
    for word in table.run.value.split_whitespace() {
        let is_file = word.ends_with(".yaml");
        let word = match is_file {
            true => {
                let at = At { value: word.to_owned(), mark: table.run.mark };
                context.file(&at)?.display().to_string()
            }
            false => word.to_owned(),
        };
        words.push(word);
    }
    Some(Action::Sdr { robot, words, fails: table.fails.as_ref().is_some_and(|at| at.value) })
}
