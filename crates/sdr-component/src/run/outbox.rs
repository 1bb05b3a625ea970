//! Words to the agent, from the execution thread to the link; never waits.

use std::collections::VecDeque;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

use sdr_core::lifecycle::LifecycleState;

use super::wake::Wake;
use crate::protocol::{FromComponent, StateReport};

/// Most words that wait; beats and counters make room, they come again.
const WORDS_MAX: usize = 1024;

/// Shared by both threads.
#[derive(Clone, Debug)]
pub(super) struct Outbox {
    inner: Arc<Mutex<Inner>>,
    wake: Wake,
}

#[derive(Debug)]
struct Inner {
    words: VecDeque<FromComponent>,
    now: StateReport,
    is_connected: bool,
    is_closed: bool,
}

impl Outbox {
    pub(super) fn new(wake: Wake) -> Self {
        let now = StateReport { state: LifecycleState::Created, token: None, fault: None };
        let inner = Inner { words: VecDeque::new(), now, is_connected: false, is_closed: false };
        Self { inner: Arc::new(Mutex::new(inner)), wake }
    }

    /// Sends a word when an agent is there; a new agent learns the rest from the greeting.
    pub(super) fn say(&self, word: FromComponent) {
        let mut inner = self.lock();
        if let FromComponent::State(now) = &word {
            inner.now = now.clone();
        }
        if !inner.is_connected {
            return;
        }
        if inner.words.len() >= WORDS_MAX {
            inner.words.retain(|word| {
                !matches!(word, FromComponent::Beat(_) | FromComponent::Counters(_))
            });
        }
        if inner.words.len() >= WORDS_MAX {
            inner.words.pop_front();
        }
        inner.words.push_back(word);
        drop(inner);
        self.wake.ring();
    }

    /// Nothing more will be said; the link ends when it has sent what waits.
    pub(super) fn close(&self) {
        self.lock().is_closed = true;
        self.wake.ring();
    }

    /// The next word to send.
    pub(super) fn take(&self) -> Option<FromComponent> {
        self.lock().words.pop_front()
    }

    pub(super) fn is_closed(&self) -> bool {
        self.lock().is_closed
    }

    /// A connection begins; returns the state for its greeting. Words queue from here on, so
    /// none about a later state is lost.
    pub(super) fn connect(&self) -> StateReport {
        let mut inner = self.lock();
        inner.words.clear();
        inner.is_connected = true;
        inner.now.clone()
    }

    pub(super) fn disconnect(&self) {
        let mut inner = self.lock();
        inner.words.clear();
        inner.is_connected = false;
    }

    fn lock(&self) -> MutexGuard<'_, Inner> {
        // No code panics while it holds this lock.
        self.inner.lock().unwrap_or_else(PoisonError::into_inner)
    }
}
