//! The coordinator role: by hand, and by which policy.

use axum::Json;
use axum::body::Bytes;
use axum::extract::State;
use sdr_core::{
    api::{Accepted, RoleAnswer, RoleMoveRequest, RolePolicyRequest},
    input::Input,
};

use super::ApiState;
use super::answer::Refusal;
use super::deploy::ask;

pub(super) async fn hand_over(
    State(state): State<ApiState>,
    body: Bytes,
) -> Result<Json<RoleAnswer>, Refusal> {
    let wanted: RoleMoveRequest = serde_json::from_slice(&body).map_err(|error| {
        Refusal::bad(&state, format!("body of /v1/role/move: {error}; wanted {{\"to\": ROBOT}}"))
    })?;
    role_answer(ask(&state, |request| Input::MoveRole { request, to: wanted.to }).await?)
}

pub(super) async fn set_policy(
    State(state): State<ApiState>,
    body: Bytes,
) -> Result<Json<RoleAnswer>, Refusal> {
    let wanted: RolePolicyRequest = serde_json::from_slice(&body).map_err(|error| {
        Refusal::bad(
            &state,
            format!("body of /v1/role/policy: {error}; wanted {{\"policy\": ...}}"),
        )
    })?;
    wanted.policy.check().map_err(|error| Refusal::bad(&state, error))?;
    let policy = Box::new(wanted.policy);
    role_answer(ask(&state, |request| Input::RolePolicy { request, policy }).await?)
}

fn role_answer(accepted: Accepted) -> Result<Json<RoleAnswer>, Refusal> {
    match accepted {
        Accepted::Role(answer) => Ok(Json(answer)),
        Accepted::System(_) | Accepted::Reset(_) => Err(Refusal::crossed()),
    }
}
