//! What a deployed system still lacks, in words.

use sdr_core::{
    allocate::Refusal,
    api::{ComponentView, SystemView},
    lifecycle::LifecycleState,
};
use serde::Serialize;

use crate::render::{
    problems::{is_active, state_words},
    progress::Frame,
    units::{count, one_line},
};

/// How far a system is, and what is still awaited.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub(super) struct Awaited {
    /// Components that are Active.
    active: usize,
    /// All components.
    components: usize,
    /// Connections that carried a sample of the present producer.
    heard: usize,
    /// All connections.
    connections: usize,
    /// Components that are not Active, with the reason.
    awaited: Vec<AwaitedComponent>,
    /// Connections that are not heard.
    unheard: Vec<String>,
}

/// One component that is not Active.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub(super) struct AwaitedComponent {
    pub(super) component: String,
    pub(super) home: Option<String>,
    state: Option<LifecycleState>,
    restarts: u32,
    reason: String,
    refusals: Vec<Refusal>,
    /// The last thing that went wrong with it, looked up when the time is over.
    pub(super) last: Option<String>,
}

impl AwaitedComponent {
    fn of(view: &ComponentView) -> Self {
        Self {
            component: view.name.clone(),
            home: view.home.clone(),
            state: view.state,
            restarts: view.restarts,
            reason: one_line(&view.reason),
            refusals: view.refusals.clone(),
            last: None,
        }
    }

    /// `position has no home: no robot fits`, `camera is created on robot-2: ...`.
    fn sentence(&self) -> String {
        let name = &self.component;
        match (&self.home, self.state) {
            (None, _) => format!("{name} has no home: {}", self.reason),
            (Some(home), Some(state)) => {
                let again = match self.restarts {
                    0 => String::new(),
                    more => format!(" after {}", count(more as usize, "restart")),
                };
                let state = state_words(state);
                format!("{name} is {state} on {home}{again}: {}", self.reason)
            }
            (Some(home), None) => format!("{name} is to start on {home}: {}", self.reason),
        }
    }
}

impl Awaited {
    /// What `revision` of the system still lacks; an older one counts for nothing.
    pub(super) fn of(view: Option<&SystemView>, revision: u64) -> Option<Self> {
        let view = view.filter(|view| view.revision >= revision)?;
        let waiting = view.components.iter().filter(|component| !is_active(component));
        let unheard = view.connections.iter().filter(|connection| !connection.heard);
        let awaited: Vec<AwaitedComponent> = waiting.map(AwaitedComponent::of).collect();
        let unheard: Vec<String> = unheard.map(|connection| connection.name.clone()).collect();
        Some(Self {
            active: view.components.len() - awaited.len(),
            components: view.components.len(),
            heard: view.connections.len() - unheard.len(),
            connections: view.connections.len(),
            awaited,
            unheard,
        })
    }

    /// Those that are not Active, to learn more of them.
    pub(super) fn components_mut(&mut self) -> impl Iterator<Item = &mut AwaitedComponent> {
        self.awaited.iter_mut()
    }

    /// Whether nothing is awaited any more.
    pub(super) fn is_done(&self) -> bool {
        self.awaited.is_empty() && self.unheard.is_empty()
    }

    /// `3 of 5 active, 2 of 5 connections heard`.
    pub(super) fn summary(&self) -> String {
        format!(
            "{} of {} active, {} of {} connections heard",
            self.active, self.components, self.heard, self.connections
        )
    }

    /// What is awaited and why, with each robot's number and bar.
    fn reasons(&self) -> Vec<String> {
        let mut lines = Vec::new();
        for component in &self.awaited {
            lines.push(format!("  {}", component.sentence()));
            let refusals = component.refusals.iter();
            lines.extend(refusals.map(|refusal| format!("    {}", one_line(&refusal.to_string()))));
            lines.extend(component.last.iter().map(|last| format!("    last: {last}")));
        }
        if self.awaited.is_empty() {
            let unheard = self.unheard.iter();
            lines.extend(unheard.map(|name| format!("  {name}: no sample accepted yet")));
        }
        lines
    }
}

/// What the wait shows of a system.
pub(super) fn frame(system: &str, view: Option<&SystemView>, awaited: Option<&Awaited>) -> Frame {
    let (Some(view), Some(awaited)) = (view, awaited) else {
        return Frame {
            head: format!("{system}: accepted, not in the view yet"),
            lines: Vec::new(),
        };
    };
    let mut lines: Vec<String> = view.components.iter().map(component_line).collect();
    if !awaited.is_done() {
        lines.push(String::from("waiting for:"));
        lines.extend(awaited.reasons());
    }
    Frame { head: format!("{system}: {}", awaited.summary()), lines }
}

/// ` ok camera      robot-2    active`.
fn component_line(component: &ComponentView) -> String {
    let mark = match (is_active(component), component.home.is_some(), component.state) {
        (true, _, _) => "ok",
        (false, false, _) | (false, true, Some(LifecycleState::Error)) => "!!",
        (false, true, _) => "..",
    };
    let home = component.home.as_deref().unwrap_or("-");
    let state = component.state.map_or_else(|| "-".into(), |state| state.to_string());
    format!(" {mark} {:<14} {home:<12} {state}", component.name)
}

/// What is missing when the time is over.
pub(super) fn shortfall(system: &str, awaited: Option<&Awaited>, seconds: f64) -> Vec<String> {
    let Some(awaited) = awaited else {
        return vec![format!(
            "sdr: {system} is not in the agent's view after {seconds:.1} s: the deployment was stored but not taken up"
        )];
    };
    let mut lines =
        vec![format!("sdr: {system} is not up after {seconds:.1} s: {}", awaited.summary())];
    lines.extend(awaited.reasons());
    lines.push("  It goes on without you.    see: sdr status; sdr events -n 20".into());
    lines
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::render::fixture;

    #[test]
    fn a_system_is_up_when_all_are_active_and_all_are_heard() {
        let mut view = fixture::exploration();
        assert!(Awaited::of(Some(&view), 1).unwrap().is_done());
        view.connections[3].heard = false;
        let awaited = Awaited::of(Some(&view), 1).unwrap();
        assert!(!awaited.is_done());
        assert_eq!(awaited.summary(), "5 of 5 active, 4 of 5 connections heard");
        assert!(awaited.reasons()[0].starts_with("  position.odometry -> controller.odometry:"));
    }

    #[test]
    fn an_older_revision_counts_for_nothing() {
        assert_eq!(Awaited::of(Some(&fixture::exploration()), 2), None);
        assert_eq!(Awaited::of(None, 1), None);
    }

    #[test]
    fn what_is_missing_is_told_with_each_robots_number_and_bar() {
        let mut view = fixture::exploration();
        fixture::make_homeless(&mut view.components[4]);
        view.components[2].state = Some(LifecycleState::Created);
        let awaited = Awaited::of(Some(&view), 1);
        let lines = shortfall("exploration", awaited.as_ref(), 60.0);
        assert_eq!(
            lines[..5],
            [
                "sdr: exploration is not up after 60.0 s: 3 of 5 active, 5 of 5 connections heard",
                "  camera is created on robot-2: robot-1: memory_free 310 MB, bar 500 MB",
                "  position has no home: no robot fits",
                "    robot-1: memory_free 310 MB, bar 500 MB",
                "    robot-2: memory_free 310 MB, bar 500 MB",
            ]
        );
    }

    #[test]
    fn the_frame_shows_each_component_and_then_what_is_awaited() {
        let mut view = fixture::exploration();
        fixture::make_homeless(&mut view.components[4]);
        let awaited = Awaited::of(Some(&view), 1);
        let frame = frame("exploration", Some(&view), awaited.as_ref());
        assert_eq!(frame.head, "exploration: 4 of 5 active, 5 of 5 connections heard");
        assert_eq!(frame.lines[0], " ok fisheye        robot-3      active");
        assert_eq!(frame.lines[4], " !! position       -            -");
        assert_eq!(frame.lines[5], "waiting for:");
    }
}
