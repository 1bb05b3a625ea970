//! A component is tried anew, whatever held it.

use axum::Json;
use axum::body::Bytes;
use axum::extract::State;
use sdr_core::{
    api::{Accepted, ResetAnswer, ResetRequest},
    id::ComponentKey,
    input::Input,
};

use super::ApiState;
use super::answer::Refusal;
use super::deploy::ask;

pub(super) async fn reset(
    State(state): State<ApiState>,
    body: Bytes,
) -> Result<Json<ResetAnswer>, Refusal> {
    let wanted: ResetRequest = serde_json::from_slice(&body).map_err(|error| {
        let wanted = "{\"system\": SYSTEM, \"component\": COMPONENT}";
        Refusal::bad(&state, format!("body of /v1/reset: {error}; wanted {wanted}"))
    })?;
    let component = ComponentKey::new(&wanted.system, &wanted.component);
    match ask(&state, |request| Input::Reset { request, component }).await? {
        Accepted::Reset(answer) => Ok(Json(answer)),
        Accepted::System(_) | Accepted::Role(_) => Err(Refusal::crossed()),
    }
}
