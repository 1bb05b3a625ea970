//! What is wrong in a view of the fleet, in sentences.

use sdr_core::{
    api::{ComponentView, RobotView, StatusView, SystemView},
    lifecycle::LifecycleState,
};

use super::units::{NOTHING, megabytes, one_line, percent, span};

/// One thing that is wrong.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) struct Problem {
    /// A sentence.
    pub(crate) text: String,
    /// Numbers beside their bars, last words.
    pub(crate) details: Vec<String>,
    /// The component that it is about, when it has a home that may tell more.
    pub(crate) component: Option<Placed>,
}

/// A component with a home.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) struct Placed {
    /// Its system.
    pub(crate) system: String,
    /// Its name.
    pub(crate) component: String,
    /// Its home.
    pub(crate) home: String,
}

impl Problem {
    fn new(text: String) -> Self {
        Self { text: one_line(&text), details: Vec::new(), component: None }
    }

    /// All of it in one line.
    pub(crate) fn sentence(self) -> String {
        let mut parts = vec![self.text];
        parts.extend(self.details);
        parts.join("; ")
    }
}

/// What is not as it should be; empty when all is well.
pub(crate) fn problems(view: &StatusView) -> Vec<Problem> {
    let mut problems: Vec<Problem> = unled(view).into_iter().collect();
    for system in &view.systems {
        let parts = system.components.iter();
        problems.extend(parts.filter_map(|component| trouble(component, system, view)));
        problems.extend(silent_connections(system, view));
    }
    let raised = view.conditions.iter().filter(|condition| condition.raised);
    problems.extend(raised.map(|condition| {
        Problem::new(format!(
            "{} of {} on {}, raised after {}: {}",
            condition.cause,
            named(&condition.system, &condition.component, view),
            view.seen_from,
            span(condition.hold_ms),
            condition.reason
        ))
    }));
    let quiet = view.robots.iter().filter(|robot| !robot.alive);
    problems.extend(quiet.map(|robot| {
        Problem::new(format!(
            "{} is quiet for {} (last: battery {}, {} free)",
            robot.name,
            span(robot.seen_ms),
            robot.battery_permille.map_or_else(|| NOTHING.into(), percent),
            megabytes(robot.memory_free_bytes)
        ))
    }));
    problems
}

/// Nobody leads: no coordinator is known, or it is quiet while something wants a home.
fn unled(view: &StatusView) -> Option<Problem> {
    let mut parts = view.systems.iter().flat_map(|system| &system.components);
    let waiting = parts.any(|component| component.home.is_none());
    let text = match &view.coordinator {
        Some(name) => {
            let quiet = |robot: &&RobotView| waiting && robot.name == *name && !robot.alive;
            let since = span(view.robots.iter().find(quiet)?.seen_ms);
            format!(
                "coordinator {name} is quiet for {since}: nothing is placed until another takes \
                 the role"
            )
        }
        None if waiting => {
            format!("{} knows no coordinator: nothing is placed until one is there", view.seen_from)
        }
        None => format!("{} knows no coordinator", view.seen_from),
    };
    Some(Problem::new(text))
}

/// A component or connection; where several systems are, the system stands before it.
fn named(system: &str, word: &str, view: &StatusView) -> String {
    match view.systems.len() {
        0 | 1 => word.to_owned(),
        _ => format!("{system}/{word}"),
    }
}

/// Why a component does not do its work, when it does not.
fn trouble(component: &ComponentView, system: &SystemView, view: &StatusView) -> Option<Problem> {
    let name = named(&system.name, &component.name, view);
    let Some(home) = &component.home else {
        let mut problem = Problem::new(format!("{name} has no home: {}", component.reason));
        let refusals = component.refusals.iter();
        problem.details = refusals.map(|refusal| one_line(&refusal.to_string())).collect();
        return Some(problem);
    };
    if view.robots.iter().any(|robot| robot.name == *home && !robot.alive) {
        return Some(Problem::new(format!("{name} was on {home}, which is quiet")));
    }
    let reason = &component.reason;
    let text = match component.state {
        Some(LifecycleState::Active) => return None,
        Some(state) => format!("{name} is {} on {home} ({reason})", state_words(state)),
        None => format!("{name} does not run yet on {home} ({reason})"),
    };
    let (system, component) = (system.name.clone(), component.name.clone());
    let placed = Placed { system, component, home: home.clone() };
    Some(Problem { component: Some(placed), ..Problem::new(text) })
}

/// `created`, but `in error`, as a sentence wants it.
pub(crate) fn state_words(state: LifecycleState) -> String {
    match state {
        LifecycleState::Error => "in error".into(),
        LifecycleState::Created
        | LifecycleState::Inactive
        | LifecycleState::Active
        | LifecycleState::Finalized => state.to_string(),
    }
}

/// Connections between active components that carry nothing.
fn silent_connections<'a>(
    system: &'a SystemView,
    view: &'a StatusView,
) -> impl Iterator<Item = Problem> + 'a {
    let active = |end: &str| {
        let name = end.split('.').next().unwrap_or(end).trim();
        system.components.iter().any(|component| component.name == name && is_active(component))
    };
    let silent = system.connections.iter().filter(move |connection| {
        !connection.heard && connection.name.split("->").all(|end| active(end.trim()))
    });
    silent.map(|connection| {
        let name = named(&system.name, &connection.name, view);
        Problem::new(format!("{name}: both ends are active, no sample arrived yet"))
    })
}

/// Whether the instance at home does its work.
pub(crate) fn is_active(component: &ComponentView) -> bool {
    component.home.is_some() && component.state == Some(LifecycleState::Active)
}
