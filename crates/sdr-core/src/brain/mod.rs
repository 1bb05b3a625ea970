//! The one place where decisions are made: inputs in, effects out.

mod config;

use alloc::{boxed::Box, collections::VecDeque};

pub use config::{BrainConfig, MakeRecovery, Seams};

use crate::{
    api::StatusView,
    effect::{Effect, StoredState},
    input::Input,
    time::Instant,
};

/// The decisions of one robot as a state machine without I/O.
///
/// After each [`Brain::handle`], poll effects until `None` before the next `handle`.
#[derive(Debug)]
pub struct Brain {
    config: BrainConfig,
    effects: VecDeque<Effect>,
}

impl Brain {
    /// A brain that continues from what its robot had on disk.
    pub fn new(
        config: BrainConfig,
        _seams: Seams,
        _stored: Option<StoredState>,
        _now: Instant,
    ) -> Box<Self> {
        Box::new(Self { config, effects: VecDeque::new() })
    }

    /// Takes one input at `now`; time never goes back.
    pub fn handle(&mut self, _now: Instant, _input: Input) {
        let _ = &self.config;
    }

    /// The next order to the shell.
    pub fn poll_effect(&mut self) -> Option<Effect> {
        self.effects.pop_front()
    }

    /// When `Input::Tick` is due at the latest.
    pub fn next_deadline(&self) -> Option<Instant> {
        None
    }

    /// What this robot believes of the fleet, for the API.
    pub fn status(&self, _now: Instant) -> StatusView {
        StatusView {
            seen_from: self.config.robot.as_str().into(),
            coordinator: None,
            term: 0,
            robots: alloc::vec::Vec::new(),
            systems: alloc::vec::Vec::new(),
            conditions: alloc::vec::Vec::new(),
        }
    }
}
