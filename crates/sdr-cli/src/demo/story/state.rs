//! What a system's status means for the story.

use sdr_core::api::SystemView;

use super::{super::stage::FADING, MOVED};
use crate::render::status::is_active;

/// `3 of 5 active, 2 of 5 connections heard`.
pub(super) fn progress(system: Option<&SystemView>) -> String {
    let Some(system) = system else { return "accepted, to be placed".to_owned() };
    let active = system.components.iter().filter(|component| is_active(component)).count();
    let heard = system.connections.iter().filter(|connection| connection.heard).count();
    let (components, connections) = (system.components.len(), system.connections.len());
    format!("{active} of {components} active, {heard} of {connections} connections heard")
}

pub(crate) fn is_up(system: &SystemView) -> bool {
    system.components.iter().all(is_active) && system.connections.iter().all(|one| one.heard)
}

/// Whether what should leave has left and everything is up again.
pub(super) fn has_moved(system: &SystemView) -> bool {
    let left = |name: &str| {
        let component = system.components.iter().find(|component| component.name == name);
        component.is_some_and(|one| one.home.as_deref().is_some_and(|home| home != FADING))
    };
    MOVED.iter().all(|name| left(name)) && is_up(system)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::render::fixture;

    #[test]
    fn the_move_is_done_when_both_left_and_all_is_up() {
        let mut system = fixture::exploration();
        assert!(has_moved(&system) && is_up(&system));
        system.connections[1].heard = false;
        assert!(!has_moved(&system));
        system.connections[1].heard = true;
        system.components[1].home = Some(FADING.to_owned());
        assert!(!has_moved(&system));
    }

    #[test]
    fn progress_counts_components_and_connections() {
        let mut system = fixture::exploration();
        system.components[0].state = None;
        assert_eq!(progress(Some(&system)), "4 of 5 active, 5 of 5 connections heard");
        assert_eq!(progress(None), "accepted, to be placed");
    }
}
