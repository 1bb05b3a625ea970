//! Answers other robots.

use std::sync::Arc;
use std::time::Duration;

use quinn::{Connection, RecvStream, SendStream, VarInt};
use sdr_core::blob::BlobHash;
use sdr_keys::Fingerprint;
use sdr_keys::stream::{REQUEST_BYTES_MAX, Request, Status};
use tokio::sync::Semaphore;
use tokio::time::timeout;

use super::Streams;

/// Robots that are served at a time.
const CONNECTIONS_MAX: usize = 32;
/// How long a request may take to arrive.
const REQUEST_WITHIN: Duration = Duration::from_secs(5);
/// How long an answer may stand still.
const STILL_MAX: Duration = Duration::from_secs(20);
/// What is handed to a stream at a time, bytes.
const PIECE_BYTES: usize = 64 * 1024;

/// Takes connections until the agent ends.
pub(super) async fn serve(streams: Streams) {
    let room = Arc::new(Semaphore::new(CONNECTIONS_MAX));
    while let Some(incoming) = streams.endpoint.accept().await {
        let Ok(place) = room.clone().try_acquire_owned() else {
            incoming.refuse();
            continue;
        };
        // When many come, each must first show that it is where it says.
        let many = room.available_permits() < CONNECTIONS_MAX / 2;
        if many && !incoming.remote_address_validated() && incoming.may_retry() {
            drop(incoming.retry());
            continue;
        }
        let streams = streams.clone();
        tokio::spawn(async move {
            match incoming.await {
                Ok(connection) => answer_all(&streams, &connection).await,
                Err(error) => tracing::debug!(event = "stream-refused", %error),
            }
            drop(place);
        });
    }
}

async fn answer_all(streams: &Streams, connection: &Connection) {
    while let Ok((send, receive)) = connection.accept_bi().await {
        // It may have been denied since the handshake.
        if bearer_of(connection).is_none_or(|bearer| streams.keys.gate().is_denied(&bearer)) {
            connection.close(VarInt::from_u32(1), b"revoked");
            return;
        }
        let streams = streams.clone();
        tokio::spawn(async move {
            if let Err(error) = answer(&streams, send, receive).await {
                tracing::debug!(event = "stream-broken", error);
            }
        });
    }
}

/// Which certificate the other end showed.
fn bearer_of(connection: &Connection) -> Option<Fingerprint> {
    let identity = connection.peer_identity()?;
    let chain = identity.downcast::<Vec<rustls::pki_types::CertificateDer<'static>>>().ok()?;
    chain.first().map(|certificate| Fingerprint::of(certificate))
}

async fn answer(
    streams: &Streams,
    mut send: SendStream,
    mut receive: RecvStream,
) -> Result<(), String> {
    let request = timeout(REQUEST_WITHIN, receive.read_to_end(REQUEST_BYTES_MAX)).await;
    let request = request.map_err(|_| "no request in time")?.map_err(|error| error.to_string())?;
    let (status, body) = match Request::decode(&request) {
        Ok(Request::Blob { hash, offset }) => blob(streams, BlobHash(hash), offset).await,
        Ok(Request::Key { have }) if have < *streams.keys.newest().borrow() => {
            let delivery = serde_json::to_vec(&streams.keys.delivery());
            (Status::Here, delivery.map_err(|error| error.to_string())?)
        }
        Ok(Request::Key { .. }) => (Status::Absent, Vec::new()),
        Err(_) => (Status::Unknown, Vec::new()),
    };
    write(&mut send, &[status.byte()]).await?;
    for piece in body.chunks(PIECE_BYTES) {
        write(&mut send, piece).await?;
    }
    send.finish().map_err(|error| error.to_string())
}

async fn write(send: &mut SendStream, bytes: &[u8]) -> Result<(), String> {
    match timeout(STILL_MAX, send.write_all(bytes)).await {
        Ok(written) => written.map_err(|error| error.to_string()),
        Err(_) => Err("the other end takes nothing".into()),
    }
}

/// Whole length, then the bytes from `offset`.
async fn blob(streams: &Streams, hash: BlobHash, offset: u64) -> (Status, Vec<u8>) {
    let store = streams.store.clone();
    let read = tokio::task::spawn_blocking(move || store.read(&hash)).await;
    let bytes = match read {
        Ok(Ok(Some(bytes))) => bytes,
        Ok(Ok(None)) | Err(_) => return (Status::Absent, Vec::new()),
        Ok(Err(error)) => {
            tracing::warn!(event = "blob-unread", %hash, %error);
            return (Status::Absent, Vec::new());
        }
    };
    let rest = usize::try_from(offset).ok().and_then(|offset| bytes.get(offset..));
    let Some(rest) = rest else { return (Status::Offset, Vec::new()) };
    let length = u64::try_from(bytes.len()).unwrap_or(u64::MAX).to_be_bytes();
    (Status::Here, [&length[..], rest].concat())
}
