//! Refusals: always JSON, always saying what is allowed.

use std::collections::BTreeMap;

use axum::Json;
use axum::extract::State;
use axum::http::{Method, StatusCode, Uri};
use axum::response::{IntoResponse, Response};
use sdr_core::api::ErrorAnswer;

use super::ApiState;
use crate::trouble::Kind;

/// An HTTP status with an [`ErrorAnswer`].
#[derive(Debug)]
pub(super) struct Refusal {
    status: StatusCode,
    answer: ErrorAnswer,
}

impl Refusal {
    pub(super) fn new(status: StatusCode, error: impl Into<String>) -> Self {
        let answer = ErrorAnswer { error: error.into(), details: BTreeMap::new() };
        Self { status, answer }
    }

    /// A request that cannot be understood: 400, and counted.
    pub(super) fn bad(state: &ApiState, error: impl Into<String>) -> Self {
        let error = error.into();
        state.trouble.count(Kind::ApiRequest, &error);
        Self::new(StatusCode::BAD_REQUEST, error)
    }

    /// The brain answered another question than was asked: a defect of this agent.
    pub(super) fn crossed() -> Self {
        Self::new(StatusCode::INTERNAL_SERVER_ERROR, "the answer belongs to another question")
    }

    /// The loop ended; so does the agent.
    pub(super) fn stopping() -> Self {
        Self::new(StatusCode::SERVICE_UNAVAILABLE, "the agent is stopping")
    }

    #[must_use]
    pub(super) fn detail(mut self, name: &str, value: impl Into<String>) -> Self {
        self.answer.details.insert(name.into(), value.into());
        self
    }
}

impl IntoResponse for Refusal {
    fn into_response(self) -> Response {
        (self.status, Json(self.answer)).into_response()
    }
}

pub(super) async fn no_such_path(State(state): State<ApiState>, uri: Uri) -> Refusal {
    let error = format!(
        "no `{}` here; there are /v1/status, /v1/deploy, /v1/systems/NAME, /v1/role/move, \
         /v1/role/policy, /v1/stop, /v1/events, \
         /v1/logs/SYSTEM/COMPONENT, /v1/components, /v1/plan, /v1/recording, /v1/health, \
         /v1/keys, /v1/blobs, /v1/blobs/HASH",
        uri.path()
    );
    state.trouble.count(Kind::ApiRequest, &error);
    Refusal::new(StatusCode::NOT_FOUND, error)
}

pub(super) async fn wrong_method(
    State(state): State<ApiState>,
    method: Method,
    uri: Uri,
) -> Refusal {
    let error = format!(
        "{method} is not for {}; POST is for /v1/deploy, /v1/role/..., /v1/stop, /v1/keys and /v1/blobs, DELETE for /v1/systems/NAME, GET for \
         all others",
        uri.path()
    );
    state.trouble.count(Kind::ApiRequest, &error);
    Refusal::new(StatusCode::METHOD_NOT_ALLOWED, error)
}
