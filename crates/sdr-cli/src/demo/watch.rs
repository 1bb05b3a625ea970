//! Looks at all agents, round after round, until what is awaited has come.

use std::{
    collections::{BTreeMap, VecDeque},
    time::{Duration, Instant},
};

use sdr_core::api::{EventView, RobotView, StatusView, SystemView};

use super::{ROBOTS, fleet::Fleet};
use crate::render::units::one_line;

/// Pause between two looks.
pub(super) const LOOK_EVERY: Duration = Duration::from_millis(150);
/// Events kept for the screen.
const NEWS_MAX: usize = 64;
/// Kinds that tell the story; the recordings hold all.
const TOLD: [&str; 20] = [
    "role-taken",
    "deployed",
    "placed",
    "homeless",
    "plan-failed",
    "condition-raised",
    "condition-cleared",
    "robot-gone",
    "exited",
    "hung",
    "error",
    "restart",
    "move-foreseen",
    "move-called-off",
    "move-started",
    "move-failed",
    "moved",
    "fenced",
    "held",
    "bad-input",
];

/// What the fleet says of itself.
#[derive(Default)]
pub(super) struct Watch {
    /// The last status of each robot, as itself sees the fleet.
    pub(super) statuses: BTreeMap<&'static str, StatusView>,
    /// What happened, oldest first.
    pub(super) news: VecDeque<News>,
    /// Why an agent gave no answer in the last round.
    pub(super) unanswered: BTreeMap<&'static str, String>,
    sequences: BTreeMap<&'static str, u64>,
}

/// One line of the story.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct News {
    /// When, by the clock of the demo.
    pub(super) at: Instant,
    /// Who says it.
    pub(super) robot: String,
    /// What.
    pub(super) text: String,
}

impl Watch {
    /// Asks every agent once.
    pub(super) async fn look(&mut self, fleet: &Fleet) {
        for agent in &fleet.agents {
            match agent.client.get::<StatusView>("/v1/status").await {
                Ok(status) => {
                    self.unanswered.remove(agent.robot);
                    self.statuses.insert(agent.robot, status);
                }
                Err(error) => {
                    let text = error.to_string();
                    let first = text.lines().next().unwrap_or_default().to_owned();
                    self.unanswered.insert(agent.robot, first);
                    continue;
                }
            }
            let since = self.sequences.get(agent.robot).copied().unwrap_or(0);
            let path = format!("/v1/events?since={since}");
            if let Ok(events) = agent.client.get::<Vec<EventView>>(&path).await {
                self.take(agent.robot, events);
            }
        }
    }

    /// Adds a line of the demo's own.
    pub(super) fn say(&mut self, robot: &str, text: &str) {
        self.push(News { at: Instant::now(), robot: robot.to_owned(), text: text.to_owned() });
    }

    /// What the first robot that answers says.
    pub(super) fn any(&self) -> Option<&StatusView> {
        ROBOTS.into_iter().find_map(|robot| self.statuses.get(robot))
    }

    /// A robot as it sees itself.
    pub(super) fn itself(&self, robot: &str) -> Option<&RobotView> {
        let status = self.statuses.get(robot)?;
        status.robots.iter().find(|view| view.name == robot)
    }

    /// The system as the robot sees it.
    pub(super) fn system(&self, robot: &str) -> Option<&SystemView> {
        self.statuses.get(robot)?.systems.first()
    }

    /// The coordinator when all robots see all robots alive and name the same one.
    pub(super) fn agreed_coordinator(&self) -> Option<&str> {
        let first = self.any()?.coordinator.as_deref()?;
        let agrees = |robot: &str| {
            self.statuses.get(robot).is_some_and(|status| {
                let alive = status.robots.iter().filter(|view| view.alive).count();
                alive == ROBOTS.len() && status.coordinator.as_deref() == Some(first)
            })
        };
        ROBOTS.into_iter().all(agrees).then_some(first)
    }

    fn take(&mut self, robot: &'static str, events: Vec<EventView>) {
        for view in events {
            let last = self.sequences.entry(robot).or_default();
            *last = (*last).max(view.sequence);
            if TOLD.contains(&view.event.kind.as_str()) {
                self.push(News {
                    at: Instant::now(),
                    robot: view.event.robot.to_string(),
                    text: told(&view),
                });
            }
        }
    }

    fn push(&mut self, news: News) {
        if self.news.len() == NEWS_MAX {
            self.news.pop_front();
        }
        self.news.push_back(news);
    }
}

/// `camera placed: robot-1: memory_free 310 MB, bar 500 MB`.
fn told(view: &EventView) -> String {
    let event = &view.event;
    let about = event.component.as_ref().map(|name| format!("{name} ")).unwrap_or_default();
    format!("{about}{}: {}", one_line(&event.kind), one_line(&event.reason))
}

#[cfg(test)]
mod tests {
    use sdr_core::{event::Event, id::RobotId};

    use super::*;
    use crate::render::fixture;

    #[test]
    fn a_coordinator_is_agreed_on_when_all_see_all_and_name_the_same() {
        let mut watch = Watch::default();
        for robot in ROBOTS {
            assert_eq!(watch.agreed_coordinator(), None);
            watch.statuses.insert(robot, fixture::fleet());
        }
        assert_eq!(watch.agreed_coordinator(), Some("robot-2"));
        watch.statuses.get_mut("robot-3").unwrap().robots[0].alive = false;
        assert_eq!(watch.agreed_coordinator(), None);
    }

    #[test]
    fn an_event_is_told_once_and_small_ones_are_not() {
        let mut watch = Watch::default();
        let robot = RobotId::new("robot-1").unwrap();
        let view = |sequence, kind| EventView {
            sequence,
            wall_ms: 0,
            monotonic_ns: 0,
            event: Event::new(kind, &robot, "why\u{1b}[2J"),
        };
        watch.take("robot-1", vec![view(1, "placed"), view(2, "heard")]);
        assert_eq!(watch.news.len(), 1);
        assert_eq!(watch.news[0].text, "placed: why [2J");
        assert_eq!(watch.sequences["robot-1"], 2);
    }
}
