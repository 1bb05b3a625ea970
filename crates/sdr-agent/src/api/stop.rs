//! `POST /v1/stop`: an operator ends this robot's components, and then its agent.

use std::time::Duration;

use axum::Json;
use axum::extract::State;
use sdr_core::api::StopAnswer;

use super::ApiState;
use crate::run::Ending;

/// The answer's way out, before the API ends as the first of all.
const ANSWER_WAY: Duration = Duration::from_millis(50);

pub(super) async fn stop(State(state): State<ApiState>) -> Json<StopAnswer> {
    let event = state.events.new_event("stop-ordered", "an operator ends components and agent");
    state.events.publish(event);
    let ending = state.ending.clone();
    tokio::spawn(async move {
        tokio::time::sleep(ANSWER_WAY).await;
        // The loop may have ended by itself.
        let _ = ending.send(Ending::All);
    });
    Json(StopAnswer { robot: state.robot.to_string() })
}
