//! Brings newer mesh keys from whoever has them.

use std::collections::BTreeMap;
use std::net::SocketAddr;
use std::time::Duration;

use sdr_core::time::Instant;
use tokio::sync::mpsc;

use super::Streams;
use crate::clock;
use crate::mesh::sealed::KeyHint;

/// Time between two questions to one address.
const ASK_PERIOD: Duration = Duration::from_secs(1);
/// Most addresses that are remembered for that.
const ASKED_MAX: usize = 256;

/// Follows hints one after the other: each comes from an address that anybody may have
/// written, so only one question is open at a time, and each address is asked rarely.
pub(super) async fn follow(streams: Streams, mut hints: mpsc::Receiver<KeyHint>) {
    let mut asked: BTreeMap<SocketAddr, Instant> = BTreeMap::new();
    while let Some(KeyHint { from, begin }) = hints.recv().await {
        let now = clock::now();
        asked.retain(|_, at| now.since(*at) < ASK_PERIOD);
        if asked.contains_key(&from) || asked.len() >= ASKED_MAX {
            continue;
        }
        asked.insert(from, now);
        let have = *streams.keys.newest().borrow();
        match streams.fetch_key(from, have).await {
            Ok(delivery) => {
                let keys = streams.keys.clone();
                let learned = tokio::task::spawn_blocking(move || {
                    keys.learn(&delivery, begin, &from.to_string())
                });
                if let Ok(Err(error)) = learned.await {
                    tracing::warn!(event = "key-not-learned", %from, %error);
                }
            }
            Err(error) => tracing::debug!(event = "key-not-fetched", %from, %error),
        }
    }
}
