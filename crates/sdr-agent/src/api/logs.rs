//! Output of components as plain text.

use std::io::{self, Read as _, Seek as _, SeekFrom};
use std::path::PathBuf;
use std::time::Duration;
use std::{convert::Infallible, fs::File};

use axum::body::{Body, Bytes};
use axum::extract::rejection::QueryRejection;
use axum::extract::{Path, Query, State};
use axum::http::{StatusCode, header};
use axum::response::{IntoResponse, Response};
use futures_util::stream;
use sdr_core::{
    api::StatusView,
    id::{ComponentKey, Name},
};
use serde::Deserialize;

use super::answer::Refusal;
use super::{ApiState, views};
use crate::supervisor::lines_at_end;

/// Lines when the client names no number.
const LINES: usize = 100;
/// Most lines of one answer.
const LINES_MAX: usize = 10_000;
/// Time between two looks at a file that is followed.
const LOOK_PERIOD: Duration = Duration::from_millis(200);
/// Most bytes handed over at once.
const CHUNK_BYTES: u64 = 64 * 1024;

#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct Wish {
    lines: Option<usize>,
    #[serde(default)]
    follow: bool,
}

pub(super) async fn logs(
    State(state): State<ApiState>,
    Path((system, component)): Path<(String, String)>,
    wish: Result<Query<Wish>, QueryRejection>,
) -> Result<Response, Refusal> {
    let Query(wish) = wish.map_err(|rejection| {
        let allowed = "allowed: lines=NUMBER, follow=true|false";
        Refusal::bad(&state, format!("/v1/logs: {}; {allowed}", rejection.body_text()))
    })?;
    let name = |word: &str| Name::new(word).map_err(|e| Refusal::bad(&state, e.to_string()));
    let key = ComponentKey::new(&name(&system)?, &name(&component)?);
    let path = state.logs.path_of(&key);
    find_home(&views::ask_status(&state).await?, &key, path.exists())?;
    let lines = wish.lines.unwrap_or(LINES).min(LINES_MAX);
    let (last, end) = match lines_at_end(&path, 0, lines) {
        Ok(found) => found,
        // Placed here, not started yet.
        Err(error) if error.kind() == io::ErrorKind::NotFound => (String::new(), 0),
        Err(error) => {
            let error = format!("{}: {error}", path.display());
            return Err(Refusal::new(StatusCode::INTERNAL_SERVER_ERROR, error));
        }
    };
    let body = if wish.follow { follow(last, path, end) } else { Body::from(last) };
    Ok(([(header::CONTENT_TYPE, "text/plain; charset=utf-8")], body).into_response())
}

/// Refuses when the log is on another robot, and says on which.
fn find_home(view: &StatusView, key: &ComponentKey, log_here: bool) -> Result<(), Refusal> {
    let components = view.systems.iter().filter(|system| system.name == key.system.as_str());
    let mut components = components.flat_map(|system| &system.components);
    let component = components.find(|component| component.name == key.name.as_str());
    let home = component.and_then(|component| component.home.as_ref());
    match home {
        Some(home) if *home == view.seen_from => Ok(()),
        Some(home) => {
            let robot = view.robots.iter().find(|robot| robot.name == *home);
            let api = robot.map(|robot| robot.api.clone()).unwrap_or_default();
            let error = format!("{key} runs on {home}; its log is there");
            Err(Refusal::new(StatusCode::NOT_FOUND, error).detail("home", home).detail("api", api))
        }
        None if log_here => Ok(()),
        None if component.is_some() => Err(Refusal::new(
            StatusCode::NOT_FOUND,
            format!("{key} has no home yet, so it has said nothing"),
        )),
        None => Err(Refusal::new(StatusCode::NOT_FOUND, format!("no component {key} is deployed"))),
    }
}

/// What is there, then all that comes until the client goes.
fn follow(first: String, path: PathBuf, end: u64) -> Body {
    let reader = (Some(first), path, end);
    Body::from_stream(stream::unfold(reader, |(first, path, mut at)| async move {
        if let Some(first) = first.filter(|first| !first.is_empty()) {
            return Some((Ok::<_, Infallible>(Bytes::from(first)), (None, path, at)));
        }
        loop {
            match read_on(&path, &mut at) {
                Ok(bytes) if !bytes.is_empty() => {
                    return Some((Ok(Bytes::from(bytes)), (None, path, at)));
                }
                // Quiet, or not there yet.
                Ok(_) | Err(_) => tokio::time::sleep(LOOK_PERIOD).await,
            }
        }
    }))
}

/// What was written behind `at`; a file that was emptied is read from its beginning.
fn read_on(path: &PathBuf, at: &mut u64) -> io::Result<Vec<u8>> {
    let mut file = File::open(path)?;
    if file.metadata()?.len() < *at {
        *at = 0;
    }
    file.seek(SeekFrom::Start(*at))?;
    let mut bytes = Vec::new();
    file.take(CHUNK_BYTES).read_to_end(&mut bytes)?;
    *at += bytes.len() as u64;
    Ok(bytes)
}
