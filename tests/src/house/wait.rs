//! Waiting for conditions.

use std::{
    thread,
    time::{Duration, Instant},
};

/// Whether `done` became true within `limit`; asked twenty times a second.
pub fn wait_for(limit: Duration, mut done: impl FnMut() -> bool) -> bool {
    let end = Instant::now() + limit;
    loop {
        if done() {
            return true;
        }
        if Instant::now() >= end {
            return false;
        }
        thread::sleep(Duration::from_millis(50));
    }
}
