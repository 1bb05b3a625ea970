//! What the home of a component last said of it that was out of the ordinary.

use std::path::Path;

use sdr_core::api::{EventView, StatusView};

use super::awaited::Awaited;
use crate::{
    client::Client,
    render::{
        problems::Placed,
        units::{one_line, shorten},
    },
};

/// Kinds of events that belong to a start that goes well.
const ROUTINE: [&str; 11] = [
    "deployed",
    "placed",
    "prepared",
    "started",
    "created",
    "inactive",
    "active",
    "heard",
    "moved",
    "finalized",
    "undeployed",
];
/// Most characters of one event.
const WORDS_MAX: usize = 300;

/// Adds to each awaited component the last thing that went wrong with it.
pub(super) async fn add(awaited: &mut Awaited, system: &str, status: &StatusView, client: &Client) {
    for component in awaited.components_mut() {
        let Some(home) = &component.home else { continue };
        let (system, component_name) = (system.into(), component.component.clone());
        let placed = Placed { system, component: component_name, home: home.clone() };
        component.last = of(&placed, status, client).await;
    }
}

/// The last thing that went wrong with a component, where its home's agent can be asked
/// from here. What cannot be learnt is left out: it is a hint.
pub(super) async fn of(placed: &Placed, status: &StatusView, client: &Client) -> Option<String> {
    let asked = match placed.home == status.seen_from {
        true => client.clone(),
        false => far_client(&placed.home, status)?,
    };
    let events: Vec<EventView> = asked.hurried().get("/v1/events").await.ok()?;
    last_of(&events, &placed.system, &placed.component)
}

/// The agent of another robot of this machine.
pub(super) fn far_client(robot: &str, status: &StatusView) -> Option<Client> {
    let view = status.robots.iter().find(|view| view.name == robot)?;
    Path::new(&view.api).exists().then(|| Client::at(&view.api))
}

fn last_of(events: &[EventView], system: &str, component: &str) -> Option<String> {
    let about = |view: &&EventView| {
        let event = &view.event;
        event.system.as_ref().is_some_and(|name| name.as_str() == system)
            && event.component.as_ref().is_some_and(|name| name.as_str() == component)
            && !ROUTINE.contains(&event.kind.as_str())
    };
    let last = events.iter().rev().find(about)?;
    let (kind, reason) = (&last.event.kind, &last.event.reason);
    let words = match reason.strip_prefix(kind.as_str()).is_some_and(|rest| rest.starts_with(':')) {
        true => reason.clone(),
        false => format!("{kind}: {reason}"),
    };
    Some(shorten(&one_line(&words), WORDS_MAX))
}

#[cfg(test)]
mod tests {
    use sdr_core::{
        event::Event,
        id::{ComponentKey, Name, RobotId},
    };

    use super::*;

    fn event(sequence: u64, kind: &str, component: &str) -> EventView {
        let robot = RobotId::new("robot-1").unwrap();
        let name = |word| Name::new(word).unwrap();
        let key = ComponentKey::new(&name("moon"), &name(component));
        let event = Event::new(kind, &robot, format!("reason {sequence}")).about(&key);
        EventView { sequence, wall_ms: 0, monotonic_ns: 0, event }
    }

    #[test]
    fn the_last_trouble_counts_and_the_restart_after_it_does_not_hide_it() {
        let events = [
            event(1, "exited", "camera"),
            event(2, "exited", "camera"),
            event(3, "started", "camera"),
            event(4, "exited", "viewer"),
        ];
        assert_eq!(last_of(&events, "moon", "camera").unwrap(), "exited: reason 2");
        assert_eq!(last_of(&events, "sun", "camera"), None);
        assert_eq!(last_of(&events[2..3], "moon", "camera"), None);
    }
}
