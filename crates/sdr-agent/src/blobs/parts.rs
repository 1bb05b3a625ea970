//! Carries out [`sdr_core::effect::Effect::Fetch`]: parts of systems, from the own disk or from
//! other robots.

use std::net::SocketAddr;

use sdr_core::{blob::BlobRef, input::Input};
use tokio::sync::mpsc;

use super::{BlobStore, Keep, Streams};

/// Where parts come from.
#[derive(Clone, Debug)]
pub(crate) struct Parts {
    store: BlobStore,
    /// `None` when the mesh is plain: only the own disk is asked.
    streams: Option<Streams>,
    inputs: mpsc::Sender<Input>,
}

impl Parts {
    /// Answers go to `inputs`.
    pub(crate) fn new(
        store: BlobStore,
        streams: Option<Streams>,
        inputs: mpsc::Sender<Input>,
    ) -> Self {
        Self { store, streams, inputs }
    }

    /// Brings a part, without waiting. Call within a runtime.
    pub(crate) fn fetch(&self, blob: BlobRef, from: Vec<SocketAddr>) {
        let parts = self.clone();
        tokio::spawn(async move {
            let result = parts.bring(blob, &from).await;
            // The loop is gone when the agent stops.
            let _ = parts.inputs.send(Input::Fetched { blob, result }).await;
        });
    }

    async fn bring(&self, blob: BlobRef, from: &[SocketAddr]) -> Result<Vec<u8>, String> {
        let (store, hash) = (self.store.clone(), blob.hash);
        let read = tokio::task::spawn_blocking(move || store.read(&hash)).await;
        match read.map_err(|error| error.to_string())? {
            Ok(Some(bytes)) => return Ok(bytes),
            Ok(None) => {}
            Err(error) => tracing::warn!(event = "blob-unread", %hash, %error),
        }
        let Some(streams) = &self.streams else {
            return Err("it is not on this disk, and a mesh without keys has no streams".into());
        };
        let mut said = vec!["it is not on this disk".to_owned()];
        for peer in from {
            match streams.fetch(*peer, hash, blob.length.into(), Keep::Elsewhere).await {
                Ok(bytes) => return Ok(bytes),
                Err(error) => said.push(error.to_string()),
            }
        }
        Err(said.join("; "))
    }
}
