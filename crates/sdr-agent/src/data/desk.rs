//! Where orders for the bridge lie until its thread picks them up.

use std::sync::{Mutex, MutexGuard, PoisonError};

use sdr_core::{effect::Route, id::RobotId};

/// The latest wish of each kind; earlier ones that were not picked up are void.
#[derive(Debug, Default)]
pub(super) struct Wanted {
    pub(super) routes: Option<Vec<Route>>,
    pub(super) robots: Option<Vec<RobotId>>,
    pub(super) taps: Option<Vec<String>>,
    pub(super) stop: bool,
}

/// Bounded by its nature: one wish of each kind.
#[derive(Debug, Default)]
pub(super) struct Desk(Mutex<Wanted>);

impl Desk {
    pub(super) fn put(&self, change: impl FnOnce(&mut Wanted)) {
        change(&mut self.lock());
    }

    pub(super) fn take(&self) -> Wanted {
        std::mem::take(&mut *self.lock())
    }

    fn lock(&self) -> MutexGuard<'_, Wanted> {
        // Wishes are whole values, whoever panicked while holding them.
        self.0.lock().unwrap_or_else(PoisonError::into_inner)
    }
}
