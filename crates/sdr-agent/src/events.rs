//! What happened, for everybody who wants to know: the log, the recording, the API.

use std::collections::VecDeque;
use std::sync::{Arc, Mutex, OnceLock, PoisonError};

use sdr_core::{api::EventView, event::Event, id::RobotId, recording::EventSample};
use tokio::sync::broadcast;

use crate::clock;
use crate::record::{RecordSender, stamp};

/// Events kept for those who ask later.
const KEPT_MAX: usize = 4096;
/// Events a follower may fall behind before it is dropped.
const BEHIND_MAX: usize = 256;

/// The book of events; cheap to clone, usable from every thread.
#[derive(Clone, Debug)]
pub(crate) struct Events {
    robot: RobotId,
    book: Arc<Mutex<Book>>,
    live: broadcast::Sender<EventView>,
    record: Arc<OnceLock<RecordSender>>,
}

#[derive(Debug, Default)]
struct Book {
    last: u64,
    kept: VecDeque<EventView>,
}

impl Events {
    /// An empty book of `robot`.
    pub(crate) fn new(robot: RobotId) -> Self {
        let (live, _) = broadcast::channel(BEHIND_MAX);
        Self { robot, book: Arc::default(), live, record: Arc::default() }
    }

    /// From now on events go into the recording as well; what was said before follows now.
    pub(crate) fn record_into(&self, sender: RecordSender) {
        let book = self.book.lock().unwrap_or_else(PoisonError::into_inner);
        for view in &book.kept {
            record(&sender, view);
        }
        // A second recording is never attached.
        let _ = self.record.set(sender);
    }

    /// A bare event of this robot.
    pub(crate) fn new_event(&self, kind: &str, reason: impl Into<String>) -> Event {
        Event::new(kind, &self.robot, reason)
    }

    /// Tells everybody.
    pub(crate) fn publish(&self, event: Event) {
        let mut book = self.book.lock().unwrap_or_else(PoisonError::into_inner);
        book.last += 1;
        let view = EventView {
            sequence: book.last,
            wall_ms: u64::try_from(clock::wall().as_millis()).unwrap_or(u64::MAX),
            monotonic_ns: clock::now().as_nanos(),
            event,
        };
        if book.kept.len() == KEPT_MAX {
            book.kept.pop_front();
        }
        book.kept.push_back(view.clone());
        // Within the lock, so that all see events in the order of their numbers.
        if let Some(sender) = self.record.get() {
            record(sender, &view);
        }
        log(&view.event);
        // No follower is no error.
        let _ = self.live.send(view);
    }

    /// What is kept after number `since`, and all that follows.
    pub(crate) fn follow(&self, since: u64) -> (Vec<EventView>, broadcast::Receiver<EventView>) {
        let book = self.book.lock().unwrap_or_else(PoisonError::into_inner);
        let kept = book.kept.iter().filter(|view| view.sequence > since).cloned().collect();
        (kept, self.live.subscribe())
    }

    /// What is kept after number `since`.
    pub(crate) fn since(&self, since: u64) -> Vec<EventView> {
        self.follow(since).0
    }
}

fn log(event: &Event) {
    let system = event.system.as_ref().map(ToString::to_string);
    let component = event.component.as_ref().map(ToString::to_string);
    let token = event.token.as_ref().map(ToString::to_string);
    tracing::info!(event = event.kind, system, component, token, "{}", event.reason);
}

fn record(sender: &RecordSender, view: &EventView) {
    let event = &view.event;
    let word = |name: &Option<sdr_core::id::Name>| {
        name.as_ref().map(ToString::to_string).unwrap_or_default()
    };
    let message = EventSample {
        stamp: stamp(),
        monotonic_ns: view.monotonic_ns,
        sequence: view.sequence,
        kind: event.kind.clone(),
        robot: event.robot.to_string(),
        system: word(&event.system),
        component: word(&event.component),
        epoch: event.token.as_ref().map_or(0, |token| token.epoch.number),
        run: event.token.as_ref().map_or(0, |token| token.run),
        reason: event.reason.clone(),
        number_names: event.numbers.keys().cloned().collect(),
        number_values: event.numbers.values().copied().collect(),
    };
    sender.record(view.monotonic_ns, &message);
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_book_is_bounded_and_numbers_go_on() {
        let events = Events::new(RobotId::new("robot-1").unwrap());
        for round in 0..KEPT_MAX + 10 {
            events.publish(events.new_event("tested", format!("round {round}")));
        }

        let kept = events.since(0);

        assert_eq!(kept.len(), KEPT_MAX);
        assert_eq!(kept[0].sequence, 11);
        assert_eq!(events.since(KEPT_MAX as u64 + 9).len(), 1);
    }
}
