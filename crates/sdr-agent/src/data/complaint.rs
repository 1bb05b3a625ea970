//! Warnings that would otherwise come with every sample.

use std::time::{Duration, Instant};

const PAUSE: Duration = Duration::from_secs(10);

/// Lets one warning through per pause.
#[derive(Debug, Default)]
pub(super) struct Complaint(Option<Instant>);

impl Complaint {
    /// Says it, unless something was said a short time ago.
    pub(super) fn say(&mut self, event: &str, path: &str, reason: &dyn std::fmt::Display) {
        if self.0.is_none_or(|said_at| said_at.elapsed() >= PAUSE) {
            self.0 = Some(Instant::now());
            tracing::warn!(event, path, %reason, "samples are dropped and counted");
        }
    }
}
