//! Blobs: kept on this robot, and brought from others.

use std::net::SocketAddr;

use axum::Json;
use axum::body::Bytes;
use axum::extract::rejection::{BytesRejection, QueryRejection};
use axum::extract::{Path, Query, State};
use axum::http::StatusCode;
use sdr_core::blob::BlobHash;
use serde::{Deserialize, Serialize};

use super::ApiState;
use super::answer::Refusal;
use crate::blobs::{FetchError, Keep, StoreError, Streams};

/// `POST /v1/blobs`.
#[derive(Debug, Serialize)]
pub(super) struct BlobView {
    /// BLAKE3 of its bytes.
    hash: String,
    /// How many bytes it has.
    length: usize,
}

/// Who has a blob that is not here.
#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct Whence {
    /// The mesh address of another robot.
    from: Option<SocketAddr>,
    /// How many bytes the blob has.
    length: Option<u64>,
}

/// Keeps the body.
pub(super) async fn keep(
    State(state): State<ApiState>,
    body: Result<Bytes, BytesRejection>,
) -> Result<Json<BlobView>, Refusal> {
    let body = body.map_err(|rejection| Refusal::new(rejection.status(), rejection.body_text()))?;
    let streams = streams(&state)?.clone();
    let length = body.len();
    let kept = tokio::task::spawn_blocking(move || streams.store().put(&body)).await;
    let hash = kept.map_err(|_| Refusal::stopping())?.map_err(|error| not_kept(&error))?;
    Ok(Json(BlobView { hash: hash.to_string(), length }))
}

/// The bytes of a blob, from this robot's disk or the robot named.
pub(super) async fn bring(
    State(state): State<ApiState>,
    Path(hash): Path<String>,
    whence: Result<Query<Whence>, QueryRejection>,
) -> Result<Vec<u8>, Refusal> {
    let Some(hash) = BlobHash::parse(&hash) else {
        let error = format!("`{hash}` is no hash; allowed: 64 hexadecimal digits, lower case");
        return Err(Refusal::bad(&state, error));
    };
    let Query(whence) = whence.map_err(|rejection| {
        let allowed = "allowed: from=IP:PORT&length=BYTES";
        Refusal::bad(&state, format!("/v1/blobs: {}; {allowed}", rejection.body_text()))
    })?;
    let streams = streams(&state)?;
    if let Whence { from: Some(from), length: Some(length) } = whence {
        let brought = streams.fetch(from, hash, length, Keep::Here).await;
        return brought.map_err(|error| not_brought(&error));
    }
    let store = streams.store().clone();
    let read = tokio::task::spawn_blocking(move || store.read(&hash)).await;
    let bytes = read.map_err(|_| Refusal::stopping())?.map_err(|error| not_kept(&error))?;
    bytes.ok_or_else(|| {
        let error = format!("blob {hash} is not here; ?from=IP:PORT&length=BYTES says who has it");
        Refusal::new(StatusCode::NOT_FOUND, error)
    })
}

fn streams(state: &ApiState) -> Result<&Streams, Refusal> {
    state.streams.as_ref().ok_or_else(|| {
        let error = "blobs travel over sealed streams alone; [mesh] keys of robot.toml makes them";
        Refusal::new(StatusCode::CONFLICT, error)
    })
}

fn not_kept(error: &StoreError) -> Refusal {
    let status = match error {
        StoreError::TooLarge { .. } => StatusCode::PAYLOAD_TOO_LARGE,
        StoreError::Hash { .. } => StatusCode::BAD_GATEWAY,
        StoreError::Io { .. } => StatusCode::INSUFFICIENT_STORAGE,
    };
    Refusal::new(status, error.to_string())
}

fn not_brought(error: &FetchError) -> Refusal {
    match error {
        FetchError::Store(error) => not_kept(error),
        FetchError::Absent(_) => Refusal::new(StatusCode::NOT_FOUND, error.to_string()),
        FetchError::Unreachable { .. } | FetchError::Answer { .. } | FetchError::Broken { .. } => {
            Refusal::new(StatusCode::BAD_GATEWAY, error.to_string())
        }
    }
}
