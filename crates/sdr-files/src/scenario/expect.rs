//! Expectations: one subject, and when it must be true.

use std::time::Duration;

use super::{
    check::Context,
    file::ExpectTable,
    types::{Choice, EventWanted, Expectation, Wanted, When},
};
use crate::read::At;

/// What subjects look like, for errors.
const SUBJECTS: &str = "allowed: component with home, home_not or state; coordinator; coordinator_not; \
     coordinators; robot with seen; running; unchanged; event; lost with at_most; pause with no_longer_than";

/// The expectation, when it is one.
pub(super) fn checked(at: &At<ExpectTable>, context: &mut Context<'_>) -> Option<Expectation> {
    let table = &at.value;
    let what = subject(at, context);
    let least = Duration::from_millis(1);
    let when = match (&table.within, &table.lasting) {
        (Some(time), None) => When::Within(context.time(time, least)),
        (None, Some(time)) => When::Lasting(context.time(time, least)),
        // Judged from the recordings, when all is over.
        (None, None) if matches!(what, Some(Wanted::Lost(..) | Wanted::Pause(..))) => {
            When::Within(Duration::ZERO)
        }
        (None, None) | (Some(_), Some(_)) if context.reader.has_told(at.mark.line) => return None,
        (None, None) | (Some(_), Some(_)) => {
            let help =
                "allowed: `within` (at some moment) or `lasting` (at every moment)".to_owned();
            context.reader.problem(at.mark, "it is not clear when this must be true", Some(help));
            return None;
        }
    };
    let seen_from = match &table.seen_from {
        Some(robot) => Some(context.robot(robot)?),
        None => None,
    };
    Some(Expectation { what: what?, when, seen_from })
}

fn subject(at: &At<ExpectTable>, context: &mut Context<'_>) -> Option<Wanted> {
    let table = &at.value;
    let mut found = Vec::new();
    if table.event.is_some() {
        found.push(event(table, context));
    } else {
        if let Some(component) = &table.component {
            found.push(of_component(component.value.clone(), at, context));
        }
        if let (Some(robot), Some(seen)) = (&table.robot, &table.seen) {
            found.push(context.robot(robot).map(|robot| Wanted::Seen(robot, seen.value.0)));
        }
    }
    if let Some(robot) = &table.coordinator {
        found.push(context.robot(robot).map(|robot| Wanted::Coordinator(Choice::Is(robot))));
    }
    if let Some(robot) = &table.coordinator_not {
        found.push(context.robot(robot).map(|robot| Wanted::Coordinator(Choice::IsNot(robot))));
    }
    if let Some(count) = &table.coordinators {
        found.push(Some(Wanted::Coordinators(count.value)));
    }
    for (flag, wanted) in [(&table.running, Wanted::Running), (&table.unchanged, Wanted::Unchanged)]
    {
        match flag.as_ref().map(|flag| (flag.value, flag.mark)) {
            Some((true, _)) => found.push(Some(wanted)),
            Some((false, mark)) => {
                context.reader.problem(mark, "only `true` can be expected", None);
                found.push(None);
            }
            None => {}
        }
    }
    if let (Some(connection), Some(most)) = (&table.lost, &table.at_most) {
        found.push(Some(Wanted::Lost(connection.value.clone(), u64::from(most.value))));
    }
    if let (Some(connection), Some(most)) = (&table.pause, &table.no_longer_than) {
        found.push(Some(Wanted::Pause(connection.value.clone(), most.value)));
    }
    if found.len() != 1 {
        if context.reader.has_told(at.mark.line) {
            return None;
        }
        let message = format!("an expectation with {} subjects", found.len());
        context.reader.problem(at.mark, message, Some(SUBJECTS.to_owned()));
        return None;
    }
    found.into_iter().next().flatten()
}

fn of_component(
    component: sdr_core::id::Name,
    at: &At<ExpectTable>,
    context: &mut Context<'_>,
) -> Option<Wanted> {
    let table = &at.value;
    match (&table.home, &table.home_not, &table.state) {
        (Some(home), None, None) => {
            context.robot(home).map(|home| Wanted::Home(component, Choice::Is(home)))
        }
        (None, Some(home), None) => {
            context.robot(home).map(|home| Wanted::Home(component, Choice::IsNot(home)))
        }
        (None, None, Some(state)) => Some(Wanted::State(component, state.value.0)),
        _ => {
            if !context.reader.has_told(at.mark.line) {
                let message = "it is not clear what is expected of the component";
                context.reader.problem(at.mark, message, Some(SUBJECTS.to_owned()));
            }
            None
        }
    }
}

fn event(table: &ExpectTable, context: &mut Context<'_>) -> Option<Wanted> {
    let kind = table.event.as_ref()?.value.clone();
    let robot = match &table.robot {
        Some(robot) => Some(context.robot(robot)?),
        None => None,
    };
    let at_most = table.at_most.as_ref().map(|at| at.value);
    let at_least = table.at_least.as_ref().map(|at| at.value);
    Some(Wanted::Event(Box::new(EventWanted {
        kind,
        robot,
        component: table.component.as_ref().map(|at| at.value.clone()),
        reason: table.reason.as_ref().map(|at| at.value.clone()),
        at_least: at_least.unwrap_or(u32::from(at_most.is_none())),
        at_most,
    })))
}
