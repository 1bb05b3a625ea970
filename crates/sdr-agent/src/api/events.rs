//! Events: those that were, and those that come.

use std::collections::VecDeque;
use std::convert::Infallible;
use std::time::Duration;

use axum::Json;
use axum::extract::rejection::QueryRejection;
use axum::extract::{Query, State};
use axum::response::sse::{Event as Message, KeepAlive, Sse};
use axum::response::{IntoResponse, Response};
use futures_util::stream;
use sdr_core::api::EventView;
use serde::Deserialize;
use tokio::sync::broadcast::{Receiver, error::RecvError};

use super::ApiState;
use super::answer::Refusal;

/// Time between two comments on a quiet stream, so that a dead client is noticed.
const KEEP_ALIVE: Duration = Duration::from_secs(15);

#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct Wish {
    /// Events with a greater number.
    #[serde(default)]
    since: u64,
    /// Whether to stay for those that come.
    #[serde(default)]
    follow: bool,
}

pub(super) async fn events(
    State(state): State<ApiState>,
    wish: Result<Query<Wish>, QueryRejection>,
) -> Result<Response, Refusal> {
    let Query(wish) = wish.map_err(|rejection| {
        let allowed = "allowed: since=NUMBER, follow=true|false";
        Refusal::bad(&state, format!("/v1/events: {}; {allowed}", rejection.body_text()))
    })?;
    if !wish.follow {
        return Ok(Json(state.events.since(wish.since)).into_response());
    }
    let (kept, live) = state.events.follow(wish.since);
    let follower = Follower { kept: kept.into(), live, since: wish.since, dropped: false };
    let messages = stream::unfold(follower, |mut follower| async move {
        follower.next().await.map(|message| (Ok::<_, Infallible>(message), follower))
    });
    Ok(Sse::new(messages).keep_alive(KeepAlive::new().interval(KEEP_ALIVE)).into_response())
}

/// One client that stays.
struct Follower {
    kept: VecDeque<EventView>,
    live: Receiver<EventView>,
    since: u64,
    dropped: bool,
}

impl Follower {
    async fn next(&mut self) -> Option<Message> {
        if let Some(view) = self.kept.pop_front() {
            return Some(message(&view));
        }
        if self.dropped {
            return None;
        }
        loop {
            match self.live.recv().await {
                Ok(view) if view.sequence <= self.since => {}
                Ok(view) => return Some(message(&view)),
                Err(RecvError::Lagged(missed)) => {
                    self.dropped = true;
                    return Some(Message::default().event("lagged").data(missed.to_string()));
                }
                Err(RecvError::Closed) => return None,
            }
        }
    }
}

fn message(view: &EventView) -> Message {
    let message = Message::default().id(view.sequence.to_string());
    match message.json_data(view) {
        Ok(message) => message,
        Err(error) => Message::default().event("error").data(error.to_string()),
    }
}
