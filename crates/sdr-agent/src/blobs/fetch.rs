//! Asks other robots.

use std::net::SocketAddr;
use std::time::Duration;

use quinn::{Connection, RecvStream};
use sdr_core::blob::BlobHash;
use sdr_keys::stream::{DELIVERY_BYTES_MAX, Request, Status};
use sdr_keys::{Delivery, KeyId};
use thiserror::Error;
use tokio::time::timeout;

use super::{BlobStore, Keep, StoreError, Streams, store::BLOB_BYTES_MAX};

/// How long a handshake may take.
const CONNECT_WITHIN: Duration = Duration::from_secs(5);
/// How long an answer may stand still.
const STILL_MAX: Duration = Duration::from_secs(20);
/// What is taken from a stream at a time, bytes.
const PIECE_BYTES: usize = 64 * 1024;

/// Why somebody did not give what was asked for. Another robot may; trying again goes on
/// from where a blob broke off.
#[derive(Debug, Error)]
pub(crate) enum FetchError {
    /// No connection, or one end refused the other.
    #[error("{peer}: {reason}")]
    Unreachable {
        /// Who was asked.
        peer: SocketAddr,
        /// What went wrong.
        reason: String,
    },
    /// It has not got it.
    #[error("{0} has not got it")]
    Absent(SocketAddr),
    /// Its answer is none.
    #[error("{peer}: {reason}")]
    Answer {
        /// Who was asked.
        peer: SocketAddr,
        /// What was wrong.
        reason: String,
    },
    /// The transfer broke; what came is kept.
    #[error("{peer}: broke off after {came} of {length} bytes: {reason}")]
    Broken {
        /// Who was asked.
        peer: SocketAddr,
        /// Bytes here now.
        came: u64,
        /// Bytes of the blob.
        length: u64,
        /// What went wrong.
        reason: String,
    },
    /// It cannot be kept.
    #[error("{0}")]
    Store(#[from] StoreError),
}

impl Streams {
    /// Brings blob `hash` of `length` bytes from the robot at `peer`: from this robot's disk
    /// when it is there, else from where an earlier transfer broke off.
    pub(crate) async fn fetch(
        &self,
        peer: SocketAddr,
        hash: BlobHash,
        length: u64,
        keep: Keep,
    ) -> Result<Vec<u8>, FetchError> {
        if length > BLOB_BYTES_MAX {
            return Err(StoreError::TooLarge { length, allowed: BLOB_BYTES_MAX }.into());
        }
        if let Some(bytes) = self.on_disk(move |store| store.read(&hash)).await? {
            return Ok(bytes);
        }
        let mut bytes = self.on_disk(move |store| store.partial(&hash)).await?;
        // More than the whole is none of it.
        if size(&bytes) > length {
            bytes.clear();
        }
        let offset = size(&bytes);
        let connection = self.connect(peer).await?;
        let request = Request::Blob { hash: hash.0, offset };
        let mut receive = ask(&connection, peer, request).await?;
        let mut said = [0; 8];
        let wrong = |reason: String| FetchError::Answer { peer, reason };
        receive.read_exact(&mut said).await.map_err(|error| wrong(error.to_string()))?;
        if u64::from_be_bytes(said) != length {
            let said = u64::from_be_bytes(said);
            return Err(wrong(format!("its blob {hash} has {said} bytes, not {length}")));
        }
        let ended = take(&mut receive, &mut bytes, length).await;
        connection.close(0_u32.into(), b"done");
        if let Err(reason) = ended {
            let came = size(&bytes);
            self.on_disk(move |store| store.keep_partial(&hash, &bytes)).await?;
            return Err(FetchError::Broken { peer, came, length, reason });
        }
        self.on_disk(move |store| store.finish(&hash, &bytes, keep).map(|()| bytes)).await
    }

    /// Disk and hashing are not for the loop's thread.
    async fn on_disk<T: Send + 'static>(
        &self,
        work: impl FnOnce(&BlobStore) -> Result<T, StoreError> + Send + 'static,
    ) -> Result<T, FetchError> {
        let store = self.store.clone();
        let done = tokio::task::spawn_blocking(move || work(&store)).await;
        Ok(done.expect("a panic there ended the agent")?)
    }

    /// The mesh key of the robot at `peer`, when it is newer than `have`.
    pub(super) async fn fetch_key(
        &self,
        peer: SocketAddr,
        have: KeyId,
    ) -> Result<Delivery, FetchError> {
        let connection = self.connect(peer).await?;
        let mut receive = ask(&connection, peer, Request::Key { have }).await?;
        let wrong = |reason: String| FetchError::Answer { peer, reason };
        let read = timeout(STILL_MAX, receive.read_to_end(DELIVERY_BYTES_MAX)).await;
        let text = read.map_err(|_| wrong("it stands still".into()))?;
        let text = text.map_err(|error| wrong(error.to_string()))?;
        connection.close(0_u32.into(), b"done");
        serde_json::from_slice(&text).map_err(|error| wrong(error.to_string()))
    }

    async fn connect(&self, peer: SocketAddr) -> Result<Connection, FetchError> {
        let unreachable = |reason: String| FetchError::Unreachable { peer, reason };
        // The name is not looked at: the certificate must be a robot's of the fleet.
        let connecting = self.endpoint.connect(peer, "robot");
        let connecting = connecting.map_err(|error| unreachable(error.to_string()))?;
        match timeout(CONNECT_WITHIN, connecting).await {
            Ok(connection) => connection.map_err(|error| unreachable(error.to_string())),
            Err(_) => Err(unreachable("no answer to the handshake".into())),
        }
    }
}

/// Sends a request; the stream behind the status of its answer.
async fn ask(
    connection: &Connection,
    peer: SocketAddr,
    request: Request,
) -> Result<RecvStream, FetchError> {
    let unreachable = |reason: String| FetchError::Unreachable { peer, reason };
    let asked = async {
        let (mut send, mut receive) =
            connection.open_bi().await.map_err(|error| unreachable(error.to_string()))?;
        send.write_all(&request.encode()).await.map_err(|error| unreachable(error.to_string()))?;
        send.finish().map_err(|error| unreachable(error.to_string()))?;
        let mut status = [0];
        let read = receive.read_exact(&mut status).await;
        // In TLS 1.3 the other end's refusal of a certificate comes here.
        read.map_err(|error| match connection.close_reason() {
            Some(reason) => unreachable(reason.to_string()),
            None => unreachable(error.to_string()),
        })?;
        Ok::<_, FetchError>((Status::of_byte(status[0]), receive))
    };
    let answered = timeout(STILL_MAX, asked).await;
    let (status, receive) = answered.map_err(|_| unreachable("no answer".into()))??;
    match status {
        Status::Here => Ok(receive),
        Status::Absent => Err(FetchError::Absent(peer)),
        Status::Offset | Status::Unknown => {
            Err(FetchError::Answer { peer, reason: format!("it answers {status:?}") })
        }
    }
}

/// Appends until there are `length` bytes.
async fn take(receive: &mut RecvStream, bytes: &mut Vec<u8>, length: u64) -> Result<(), String> {
    while size(bytes) < length {
        let piece = timeout(STILL_MAX, receive.read_chunk(PIECE_BYTES, true)).await;
        let piece = piece.map_err(|_| "it stands still")?.map_err(|error| error.to_string())?;
        let piece = piece.ok_or("its stream ended")?.bytes;
        if size(bytes) + size(&piece) > length {
            return Err("more bytes than the blob has".into());
        }
        bytes.extend_from_slice(&piece);
    }
    Ok(())
}

fn size(bytes: &[u8]) -> u64 {
    u64::try_from(bytes.len()).unwrap_or(u64::MAX)
}
