//! Looks at every agent all the time: its view of the fleet, and its events.

use std::{
    collections::BTreeMap,
    sync::{Arc, Mutex, MutexGuard, PoisonError},
    time::{Duration, Instant},
};

use sdr_core::api::{EventView, StatusView};
use tokio::task::JoinHandle;

use crate::client::Client;

/// Between two looks at one agent.
const LOOK_EVERY: Duration = Duration::from_millis(40);
/// A view older than this is none: the agent does not answer.
const FRESH: Duration = Duration::from_millis(1500);

/// What was seen.
#[derive(Debug, Default)]
pub(super) struct Seen {
    views: BTreeMap<usize, (Instant, StatusView)>,
    /// Events of all agents, in the order they were read.
    pub(super) events: Vec<EventView>,
    /// Last sequence read from an agent, forgotten when it is started again.
    sequences: BTreeMap<usize, u64>,
}

impl Seen {
    /// The view of a robot's agent, when it answers.
    pub(super) fn view(&self, robot: usize) -> Option<&StatusView> {
        self.views.get(&robot).filter(|(at, _)| at.elapsed() < FRESH).map(|(_, view)| view)
    }

    /// The views of all that answer.
    pub(super) fn views(&self) -> impl Iterator<Item = &StatusView> {
        self.views.values().filter(|(at, _)| at.elapsed() < FRESH).map(|(_, view)| view)
    }

    /// A robot's agent begins anew, or is gone.
    pub(super) fn forget(&mut self, robot: usize) {
        self.views.remove(&robot);
        self.sequences.remove(&robot);
    }
}

/// The looking tasks. Dropping it ends them.
pub(super) struct Eyes {
    seen: Arc<Mutex<Seen>>,
    tasks: Vec<JoinHandle<()>>,
}

impl Eyes {
    /// Looks at the agents behind these clients, in the order of the robots.
    pub(super) fn open(clients: Vec<Client>) -> Self {
        let seen = Arc::new(Mutex::new(Seen::default()));
        let tasks = clients.into_iter().enumerate();
        let tasks =
            tasks.map(|(robot, client)| tokio::spawn(look(robot, client.hurried(), seen.clone())));
        let tasks = tasks.collect();
        Self { seen, tasks }
    }

    /// What was seen until now.
    pub(super) fn seen(&self) -> MutexGuard<'_, Seen> {
        lock(&self.seen)
    }
}

impl Drop for Eyes {
    fn drop(&mut self) {
        self.tasks.iter().for_each(JoinHandle::abort);
    }
}

fn lock(seen: &Mutex<Seen>) -> MutexGuard<'_, Seen> {
    seen.lock().unwrap_or_else(PoisonError::into_inner)
}

async fn look(robot: usize, client: Client, seen: Arc<Mutex<Seen>>) {
    loop {
        tokio::time::sleep(LOOK_EVERY).await;
        // One that does not answer is asked again; its view gets old meanwhile.
        let asked = Instant::now();
        let Ok(view) = client.get::<StatusView>("/v1/status").await else { continue };
        let since = lock(&seen).sequences.get(&robot).copied().unwrap_or(0);
        let events = client.get::<Vec<EventView>>(&format!("/v1/events?since={since}")).await;
        let mut seen = lock(&seen);
        // As old as the question, so that what was forgotten meanwhile does not come back as news.
        seen.views.insert(robot, (asked, view));
        let Ok(events) = events else { continue };
        if seen.sequences.get(&robot).copied().unwrap_or(0) != since {
            continue;
        }
        if let Some(last) = events.last() {
            seen.sequences.insert(robot, last.sequence);
        }
        seen.events.extend(events);
    }
}
