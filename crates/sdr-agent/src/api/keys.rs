//! Newer keys from an operator.

use axum::Json;
use axum::body::Bytes;
use axum::extract::State;
use axum::http::StatusCode;
use sdr_keys::seal::Begin;
use sdr_keys::{Delivery, DeliveryAnswer};

use super::ApiState;
use super::answer::Refusal;
use crate::mesh::keys::{Learned, NotLearned};
use crate::trouble::Kind;

/// `POST /v1/keys`: this robot takes them, and the others learn them from it.
pub(super) async fn keys(
    State(state): State<ApiState>,
    body: Bytes,
) -> Result<Json<DeliveryAnswer>, Refusal> {
    let Some(keys) = state.keys.clone() else {
        let error = "this mesh is not sealed; [mesh] keys of robot.toml seals it";
        return Err(Refusal::new(StatusCode::CONFLICT, error));
    };
    let delivery: Delivery = serde_json::from_slice(&body).map_err(|error| {
        // Where it is wrong, and not what stands there.
        let place = format!("line {} column {}", error.line(), error.column());
        Refusal::bad(
            &state,
            format!("body of /v1/keys: wrong at {place}; `sdr keys push` sends it"),
        )
    })?;
    let learning = keys.clone();
    let learned = tokio::task::spawn_blocking(move || {
        learning.learn(&delivery, Begin::AfterGrace, "an operator")
    });
    let learned = match learned.await {
        Ok(Ok(learned)) => learned,
        Ok(Err(NotLearned::Delivery(error))) => {
            let error = format!("/v1/keys: {error}");
            state.trouble.count(Kind::KeyRefused, &error);
            return Err(Refusal::new(StatusCode::UNPROCESSABLE_ENTITY, error));
        }
        Ok(Err(NotLearned::Disk(error))) => {
            return Err(Refusal::new(StatusCode::INSUFFICIENT_STORAGE, error.to_string()));
        }
        Err(_) => return Err(Refusal::stopping()),
    };
    let newest_key = keys.newest().borrow().0;
    Ok(Json(DeliveryAnswer {
        robot: state.robot.to_string(),
        newest_key,
        denied: keys.denied(),
        changed: learned == Learned::News,
    }))
}
