//! What the robot knows, at one moment.

use std::collections::BTreeMap;
use std::path::PathBuf;
use std::sync::PoisonError;

use axum::Json;
use axum::extract::State;
use axum::http::StatusCode;
use sdr_core::{
    api::{PlanView, StatusView},
    mesh::MeshCounters,
};
use serde::Serialize;
use tokio::sync::oneshot;

use super::answer::Refusal;
use super::{ApiState, Question};
use crate::clock;
use crate::data::Way;
use crate::mesh::keys::FleetKeys;

/// `GET /v1/health`.
#[derive(Debug, Serialize)]
pub(super) struct HealthView {
    /// The robot that answers.
    robot: String,
    /// The agent's version.
    version: &'static str,
    /// Its process.
    pid: u32,
    /// Bad input so far, by kind.
    bad_input: BTreeMap<String, u64>,
    /// What the mesh counted.
    mesh: MeshView,
    /// Keys of the mesh; null when it is plain.
    keys: Option<KeysView>,
    /// What crossed this robot's border.
    routes: Vec<RouteView>,
}

/// Counters of the mesh since the agent's start.
#[derive(Debug, Serialize)]
struct MeshView {
    received: u64,
    malformed: u64,
    foreign: u64,
    stale: u64,
    refused: u64,
    sent: u64,
    sent_bytes: u64,
}

/// Keys, and what the seal counted since the agent's start.
#[derive(Debug, Serialize)]
struct KeysView {
    fleet: String,
    newest: u16,
    seals_with: u16,
    denied: usize,
    opened: u64,
    proven: u64,
    refused: BTreeMap<&'static str, u64>,
}

/// Counters of one route since it was made.
#[derive(Debug, Serialize)]
struct RouteView {
    path: String,
    way: &'static str,
    #[serde(flatten)]
    counters: BTreeMap<&'static str, u64>,
}

/// `GET /v1/recording`.
#[derive(Debug, Serialize)]
pub(super) struct RecordingView {
    /// The file; complete up to the moment of the request.
    path: PathBuf,
}

pub(super) async fn status(State(state): State<ApiState>) -> Result<Json<StatusView>, Refusal> {
    ask_status(&state).await.map(Json)
}

/// Asks the loop.
pub(super) async fn ask_status(state: &ApiState) -> Result<StatusView, Refusal> {
    let (sender, receiver) = oneshot::channel();
    state.questions.send(Question::Status(sender)).await.map_err(|_| Refusal::stopping())?;
    receiver.await.map_err(|_| Refusal::stopping())
}

pub(super) async fn health(State(state): State<ApiState>) -> Result<Json<HealthView>, Refusal> {
    let (sender, receiver) = oneshot::channel();
    state.questions.send(Question::Mesh(sender)).await.map_err(|_| Refusal::stopping())?;
    let counted = receiver.await.map_err(|_| Refusal::stopping())?;
    let routes = state.routes.read().into_iter().map(|(path, way, counters)| RouteView {
        path,
        way: match way {
            Way::Out => "out",
            Way::In => "in",
        },
        counters: counters.named().collect(),
    });
    Ok(Json(HealthView {
        robot: state.robot.to_string(),
        version: env!("CARGO_PKG_VERSION"),
        pid: std::process::id(),
        bad_input: state.trouble.counters(),
        mesh: mesh_view(&counted),
        keys: state.keys.as_ref().map(keys_view),
        routes: routes.collect(),
    }))
}

fn mesh_view(counted: &MeshCounters) -> MeshView {
    let MeshCounters { received, malformed, foreign, stale, refused, sent, sent_bytes } = *counted;
    MeshView { received, malformed, foreign, stale, refused, sent, sent_bytes }
}

fn keys_view(keys: &FleetKeys) -> KeysView {
    let counted = keys.counters();
    let newest = keys.newest().borrow().0;
    let seals_with = keys.seal().keyring().seals_with(clock::now()).0;
    let refused = [
        ("not_sealed", counted.not_sealed),
        ("no_key", counted.no_key),
        ("retired", counted.retired),
        ("forged", counted.forged),
        ("replayed", counted.replayed),
        ("unproven", counted.unproven),
        ("stray", counted.stray),
        ("own", counted.own),
    ];
    KeysView {
        fleet: keys.identity().fleet().into(),
        newest,
        seals_with,
        denied: keys.denied(),
        opened: counted.opened,
        proven: counted.proven,
        refused: refused.into_iter().collect(),
    }
}

pub(super) async fn plan(State(state): State<ApiState>) -> Json<PlanView> {
    Json(state.plan.lock().unwrap_or_else(PoisonError::into_inner).clone())
}

pub(super) async fn recording(
    State(state): State<ApiState>,
) -> Result<Json<RecordingView>, Refusal> {
    let Some(flusher) = state.recording else {
        let error = "nothing is recorded; [storage] recordings of robot.toml turns it on";
        return Err(Refusal::new(StatusCode::NOT_FOUND, error));
    };
    match tokio::task::spawn_blocking(move || flusher.flush()).await {
        Ok(path) => Ok(Json(RecordingView { path })),
        Err(error) => {
            Err(Refusal::new(StatusCode::INTERNAL_SERVER_ERROR, format!("not flushed: {error}")))
        }
    }
}
