//! Whether an expectation is true now, as the agents see the fleet.

use sdr_core::{
    api::{ComponentView, EventView, StatusView},
    lifecycle::LifecycleState,
};
use sdr_files::{
    Scenario,
    scenario::{Choice, EventWanted, Expectation, Wanted},
};

use super::{config::index_of, eyes::Seen};
use crate::{demo::is_up, render::status::is_active};

/// Events that say that a process or a home changed.
const CHANGES: [&str; 8] =
    ["started", "exited", "ended", "hung", "move-started", "moved", "fenced", "drained"];

/// What was found.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) enum Found {
    /// It is true.
    True(String),
    /// It is not, and this is.
    False(String),
    /// Nobody answers who could tell.
    Unknown,
}

/// The events and views that one expectation is held against.
pub(super) struct Bench<'a> {
    pub(super) scenario: &'a Scenario,
    pub(super) seen: &'a Seen,
    /// Events before are not meant, CLOCK_MONOTONIC.
    pub(super) since_ns: u64,
}

impl Bench<'_> {
    /// Judges it now; those that need the recordings are unknown.
    pub(super) fn judge(&self, expectation: &Expectation) -> Found {
        let from = expectation.seen_from.as_ref().map(|robot| index_of(self.scenario, robot));
        match &expectation.what {
            Wanted::Home(component, choice) => self.home(component.as_str(), choice, from),
            Wanted::State(component, state) => self.state(component.as_str(), *state, from),
            Wanted::Coordinator(choice) => self.coordinator(choice, from),
            Wanted::Coordinators(count) => self.coordinators(usize::from(*count)),
            Wanted::Seen(robot, alive) => self.is_seen(robot.as_str(), *alive, from),
            Wanted::Running => self.running(from),
            Wanted::Unchanged => self.unchanged(),
            Wanted::Event(wanted) => self.event(wanted),
            Wanted::Lost(..) | Wanted::Pause(..) => Found::Unknown,
        }
    }

    /// The views that count: the one asked for, or all.
    fn views(&self, from: Option<usize>) -> Vec<&StatusView> {
        match from {
            Some(robot) => self.seen.view(robot).into_iter().collect(),
            None => self.seen.views().collect(),
        }
    }

    fn home(&self, component: &str, choice: &Choice, from: Option<usize>) -> Found {
        let wanted = |home: &str| match choice {
            Choice::Is(robot) => robot.as_str() == home,
            Choice::IsNot(robot) => robot.as_str() != home,
        };
        let views = self.views(from);
        let mut others = Vec::new();
        for view in views {
            let Some(found) = component_in(view, component) else { continue };
            let home = found.home.as_deref().unwrap_or("nowhere");
            // The home itself knows best.
            let counts = from.is_some() || home == view.seen_from;
            let state = if is_active(found) { "active" } else { "not active" };
            let words = format!("{component} {state} at {home}, says {}", view.seen_from);
            if counts && is_active(found) && wanted(home) {
                return Found::True(words);
            }
            others.push(words);
        }
        others.into_iter().next().map_or(Found::Unknown, Found::False)
    }

    fn state(&self, component: &str, wanted: Option<LifecycleState>, from: Option<usize>) -> Found {
        let views = self.views(from);
        let found: Vec<(&StatusView, &ComponentView)> =
            views.iter().filter_map(|view| Some((*view, component_in(view, component)?))).collect();
        let own = found.iter().find(|(view, one)| one.home.as_deref() == Some(&view.seen_from));
        let Some((view, one)) = own.or(found.first()) else {
            return match (views.first(), wanted) {
                (None, _) => Found::Unknown,
                (Some(_), None) => Found::True(format!("nobody knows {component}")),
                (Some(_), Some(_)) => Found::False(format!("nobody knows {component}")),
            };
        };
        let words = format!("{component} {:?}, says {}", one.state, view.seen_from);
        told(one.state == wanted, words)
    }

    fn coordinator(&self, choice: &Choice, from: Option<usize>) -> Found {
        let views = self.views(from);
        let holders: Vec<&str> =
            views.iter().map(|view| view.coordinator.as_deref().unwrap_or("nobody")).collect();
        let Some(first) = holders.first() else { return Found::Unknown };
        let agreed = holders.iter().all(|holder| holder == first);
        let wanted = match choice {
            Choice::Is(robot) => robot.as_str() == *first,
            Choice::IsNot(robot) => robot.as_str() != *first && *first != "nobody",
        };
        told(agreed && wanted, format!("coordinator: {}", holders.join(", ")))
    }

    fn coordinators(&self, count: usize) -> Found {
        let views = self.views(None);
        if views.is_empty() {
            return Found::Unknown;
        }
        let holds = |view: &&&StatusView| {
            view.role.holder.as_deref() == Some(&view.seen_from) && !view.role.suspended
        };
        let holders: Vec<&str> =
            views.iter().filter(holds).map(|view| view.seen_from.as_str()).collect();
        told(
            holders.len() == count,
            format!("{} hold the role: {}", holders.len(), holders.join(", ")),
        )
    }

    fn is_seen(&self, robot: &str, alive: bool, from: Option<usize>) -> Found {
        let views = self.views(from);
        let others: Vec<&&StatusView> =
            views.iter().filter(|view| view.seen_from != robot).collect();
        let sees =
            |view: &&&StatusView| view.robots.iter().any(|one| one.name == robot && one.alive);
        if others.is_empty() {
            return Found::Unknown;
        }
        let seeing = others.iter().filter(|view| sees(view)).count();
        let wanted = if alive { seeing == others.len() } else { seeing == 0 };
        told(wanted, format!("{seeing} of {} see {robot} alive", others.len()))
    }

    fn running(&self, from: Option<usize>) -> Found {
        let views = self.views(from);
        if views.is_empty() {
            return Found::Unknown;
        }
        for view in views {
            if view.systems.is_empty() {
                return Found::False(format!("{} knows no system", view.seen_from));
            }
            if let Some(system) = view.systems.iter().find(|system| !is_up(system)) {
                let waits: Vec<&str> = system
                    .components
                    .iter()
                    .filter(|one| !is_active(one))
                    .map(|one| one.name.as_str())
                    .chain(
                        system
                            .connections
                            .iter()
                            .filter(|one| !one.heard)
                            .map(|one| one.name.as_str()),
                    )
                    .collect();
                return Found::False(format!("{} waits for {}", view.seen_from, waits.join(", ")));
            }
        }
        Found::True("all active and heard".to_owned())
    }

    fn events(&self) -> impl Iterator<Item = &EventView> {
        self.seen.events.iter().filter(|view| view.monotonic_ns >= self.since_ns)
    }

    fn unchanged(&self) -> Found {
        let mut changes = self.events().filter(|view| CHANGES.contains(&view.event.kind.as_str()));
        match changes.next() {
            None => Found::True("nothing started, ended or moved".to_owned()),
            Some(first) => Found::False(told_event(first)),
        }
    }

    fn event(&self, wanted: &EventWanted) -> Found {
        let fits = |view: &&EventView| {
            let event = &view.event;
            event.kind == wanted.kind
                && wanted.robot.as_ref().is_none_or(|robot| *robot == event.robot)
                && wanted
                    .component
                    .as_ref()
                    .is_none_or(|name| event.component.as_ref() == Some(name))
                && wanted.reason.as_ref().is_none_or(|part| event.reason.contains(part.as_str()))
        };
        let found: Vec<&EventView> = self.events().filter(fits).collect();
        let count = u32::try_from(found.len()).unwrap_or(u32::MAX);
        let enough = count >= wanted.at_least && wanted.at_most.is_none_or(|most| count <= most);
        let last =
            found.last().map(|view| format!(", last: {}", told_event(view))).unwrap_or_default();
        told(enough, format!("{count} times `{}`{last}", wanted.kind))
    }
}

fn component_in<'a>(view: &'a StatusView, name: &str) -> Option<&'a ComponentView> {
    view.systems.iter().flat_map(|system| &system.components).find(|one| one.name == name)
}

fn told(is: bool, words: String) -> Found {
    if is { Found::True(words) } else { Found::False(words) }
}

fn told_event(view: &EventView) -> String {
    let event = &view.event;
    let about = event.component.as_ref().map(|name| format!(" {name}")).unwrap_or_default();
    format!("{}{about} {}: {}", event.robot, event.kind, event.reason)
}
