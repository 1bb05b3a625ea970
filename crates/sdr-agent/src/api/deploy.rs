//! Systems come and go.

use std::time::Duration;

use axum::Json;
use axum::body::Bytes;
use axum::extract::{FromRequest as _, Path, Request, State};
use axum::http::{StatusCode, header};
use sdr_core::{
    api::{Accepted, DeployAnswer, DeployRequest},
    id::Name,
    input::{Input, RequestId},
};

use super::answer::Refusal;
use super::{ApiState, SYSTEM_BYTES_MAX};
use crate::installed::{Look, LoopEnded};

/// How long the brain and the disk have to accept a system.
const ANSWER_MAX: Duration = Duration::from_secs(10);

pub(super) async fn deploy(
    State(state): State<ApiState>,
    request: Request,
) -> Result<Json<DeployAnswer>, Refusal> {
    // Before the body is waited for: it may never come.
    if announced(&request).is_some_and(|length| length > SYSTEM_BYTES_MAX) {
        return Err(too_large());
    }
    let body = Bytes::from_request(request, &()).await;
    let body = body.map_err(|rejection| match rejection.status() {
        StatusCode::PAYLOAD_TOO_LARGE => too_large(),
        _ => Refusal::bad(&state, rejection.body_text()),
    })?;
    let request: DeployRequest = serde_json::from_slice(&body).map_err(|error| {
        Refusal::bad(&state, format!("body of /v1/deploy: {error}; wanted {{\"system\": ...}}"))
    })?;
    if let Err(error) = request.system.check() {
        let error = format!("system `{}`: {error}", request.system.name);
        return Err(Refusal::new(StatusCode::UNPROCESSABLE_ENTITY, error));
    }
    // What was installed a moment ago counts.
    state.installed.refresh(Look::Thorough).await.map_err(|LoopEnded| Refusal::stopping())?;
    let wish = |request_id| Input::Deploy { request: request_id, system: request.system };
    system_answer(ask(&state, wish).await?)
}

/// The length of the body as its head says.
fn announced(request: &Request) -> Option<usize> {
    request.headers().get(header::CONTENT_LENGTH)?.to_str().ok()?.parse().ok()
}

fn too_large() -> Refusal {
    let error = format!("the body is larger than {SYSTEM_BYTES_MAX} bytes");
    Refusal::new(StatusCode::PAYLOAD_TOO_LARGE, error)
}

pub(super) async fn undeploy(
    State(state): State<ApiState>,
    Path(word): Path<String>,
) -> Result<Json<DeployAnswer>, Refusal> {
    let system = Name::new(&word).map_err(|error| Refusal::bad(&state, error.to_string()))?;
    system_answer(ask(&state, |request| Input::Undeploy { request, system }).await?)
}

fn system_answer(accepted: Accepted) -> Result<Json<DeployAnswer>, Refusal> {
    match accepted {
        Accepted::System(answer) => Ok(Json(answer)),
        Accepted::Role(_) | Accepted::Reset(_) => Err(Refusal::crossed()),
    }
}

/// Puts a wish to the brain and waits for its answer, which comes when it is on disk.
pub(super) async fn ask(
    state: &ApiState,
    wish: impl FnOnce(RequestId) -> Input,
) -> Result<Accepted, Refusal> {
    let (request, answer) = state.desk.open();
    let asked = async {
        state.inputs.send(wish(request)).await.map_err(|_| Refusal::stopping())?;
        answer.await.map_err(|_| Refusal::stopping())
    };
    let answered = tokio::time::timeout(ANSWER_MAX, asked).await;
    state.desk.close(request);
    match answered {
        Ok(Ok(Ok(answer))) => Ok(answer),
        Ok(Ok(Err(sentence))) => Err(Refusal::new(StatusCode::CONFLICT, sentence)),
        Ok(Err(refusal)) => Err(refusal),
        Err(_elapsed) => Err(Refusal::new(
            StatusCode::GATEWAY_TIMEOUT,
            format!("not accepted within {} s; the disk may be slow", ANSWER_MAX.as_secs()),
        )),
    }
}
