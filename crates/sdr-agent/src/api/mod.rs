//! HTTP and JSON: on a Unix socket for `sdr` and programs on this robot, over TLS for operators
//! of other machines.

mod answer;
mod blobs;
mod components;
mod connection;
mod deploy;
mod events;
mod keys;
mod logs;
mod remote;
mod reset;
mod role;
mod stop;
mod views;

use std::collections::BTreeMap;
use std::net::SocketAddr;
use std::os::unix::fs::PermissionsExt as _;
use std::path::{Path, PathBuf};
use std::sync::{Arc, Mutex, PoisonError};
use std::{fs, io};

use axum::Router;
use axum::extract::DefaultBodyLimit;
use axum::routing::{delete, get, post};
use sdr_core::{
    api::{Accepted, PlanView, StatusView},
    id::RobotId,
    input::{Input, RequestId},
    mesh::MeshCounters,
};
use thiserror::Error;
use tokio::net::{TcpListener, UnixListener, UnixStream};
use tokio::sync::{mpsc, oneshot, watch};
use tokio::task::JoinHandle;

use crate::blobs::{BLOB_BYTES_MAX, Streams};
use crate::data::Ledger;
use crate::events::Events;
use crate::installed::Installed;
use crate::mesh::keys::FleetKeys;
use crate::record::Flusher;
use crate::run::Ending;
use crate::supervisor::LogFiles;
use crate::trouble::Trouble;
pub(crate) use components::Profiles;

/// Largest body of a request, bytes.
const BODY_BYTES_MAX: usize = 1 << 20;
/// Largest body of a deployment: a system with its large parts, as text.
const SYSTEM_BYTES_MAX: usize = 16 << 20;

/// A question that only the loop can answer, since it holds the brain.
#[derive(Debug)]
pub(crate) enum Question {
    /// What it believes of the fleet.
    Status(oneshot::Sender<StatusView>),
    /// What its mesh counted.
    Mesh(oneshot::Sender<MeshCounters>),
}

/// What the API needs of the rest of the agent.
#[derive(Clone, Debug)]
pub(crate) struct ApiState {
    pub(crate) robot: RobotId,
    pub(crate) inputs: mpsc::Sender<Input>,
    pub(crate) questions: mpsc::Sender<Question>,
    pub(crate) desk: AnswerDesk,
    pub(crate) events: Events,
    pub(crate) trouble: Trouble,
    pub(crate) plan: LatestPlan,
    /// What the bridge counts.
    pub(crate) routes: Arc<Ledger>,
    pub(crate) logs: LogFiles,
    pub(crate) installed: Installed,
    /// `None` when nothing is recorded.
    pub(crate) recording: Option<Flusher>,
    pub(crate) profiles: Profiles,
    /// `None` when the mesh is plain.
    pub(crate) keys: Option<FleetKeys>,
    /// `None` when the mesh is plain.
    pub(crate) streams: Option<Streams>,
    /// Ends the agent.
    pub(crate) ending: watch::Sender<Ending>,
}

/// The plan that was made last, empty before the first.
pub(crate) type LatestPlan = Arc<Mutex<PlanView>>;

/// Requests that wait for [`sdr_core::effect::Effect::Answer`].
#[derive(Clone, Debug, Default)]
pub(crate) struct AnswerDesk(Arc<Mutex<Waiting>>);

type Answer = Result<Accepted, String>;

#[derive(Debug, Default)]
struct Waiting {
    last: RequestId,
    open: BTreeMap<RequestId, oneshot::Sender<Answer>>,
}

/// Why the API does not listen. The operator can mend it; nothing else was started.
#[derive(Debug, Error)]
pub(crate) enum ApiError {
    /// An agent runs on this robot already.
    #[error("{}: another agent answers there; one robot has one agent", .0.display())]
    Taken(PathBuf),
    /// The port for other machines cannot be had.
    #[error("listen at {address}: {source}")]
    Listen {
        /// From robot.toml.
        address: SocketAddr,
        /// What the system said.
        source: io::Error,
    },
    /// The system refused.
    #[error("{}: {source}", path.display())]
    Socket {
        /// The socket.
        path: PathBuf,
        /// What the system said.
        source: io::Error,
    },
}

/// The running server.
#[derive(Debug)]
pub(crate) struct Api {
    path: PathBuf,
    server: JoinHandle<()>,
    remote: Option<JoinHandle<()>>,
}

impl Api {
    /// Serves requests on `listener`, which was opened at `path`, and on `remote`.
    pub(crate) fn start(
        path: PathBuf,
        listener: UnixListener,
        remote: Option<TcpListener>,
        state: ApiState,
    ) -> Self {
        let keys = state.keys.clone();
        let remote = remote.zip(keys);
        let remote = remote.map(|(listener, keys)| remote::serve(listener, keys, state.clone()));
        let server = tokio::spawn(async move {
            if let Err(error) = axum::serve(listener, router(state)).await {
                tracing::error!(event = "api-lost", %error, next = "restart the agent");
            }
        });
        Self { path, server, remote }
    }

    /// Ends all connections and removes the socket.
    pub(crate) fn stop(&self) {
        self.server.abort();
        if let Some(remote) = &self.remote {
            remote.abort();
        }
        if let Err(error) = fs::remove_file(&self.path) {
            tracing::debug!(event = "socket-left", path = %self.path.display(), %error);
        }
    }
}

impl AnswerDesk {
    /// A number for a new request, and where its answer will come.
    fn open(&self) -> (RequestId, oneshot::Receiver<Answer>) {
        let (sender, receiver) = oneshot::channel();
        let mut waiting = self.0.lock().unwrap_or_else(PoisonError::into_inner);
        waiting.last += 1;
        let request = waiting.last;
        waiting.open.insert(request, sender);
        (request, receiver)
    }

    /// Nobody waits for it any more.
    fn close(&self, request: RequestId) {
        self.0.lock().unwrap_or_else(PoisonError::into_inner).open.remove(&request);
    }

    /// Answers a request; nothing happens when its client has gone.
    pub(crate) fn answer(&self, request: RequestId, answer: Answer) {
        let mut waiting = self.0.lock().unwrap_or_else(PoisonError::into_inner);
        if let Some(client) = waiting.open.remove(&request) {
            // The client may go at this very moment.
            let _ = client.send(answer);
        }
    }
}

/// Opens the socket at `path` for its user and group. What a dead agent left is replaced.
pub(crate) async fn open(path: &Path) -> Result<UnixListener, ApiError> {
    if UnixStream::connect(path).await.is_ok() {
        return Err(ApiError::Taken(path.into()));
    }
    bind(path).map_err(|source| ApiError::Socket { path: path.into(), source })
}

/// Opens the port for operators of other machines, when robot.toml names one.
pub(crate) async fn open_remote(
    address: Option<SocketAddr>,
) -> Result<Option<TcpListener>, ApiError> {
    let Some(address) = address else { return Ok(None) };
    let listener = TcpListener::bind(address).await;
    listener.map(Some).map_err(|source| ApiError::Listen { address, source })
}

fn bind(path: &Path) -> io::Result<UnixListener> {
    if let Some(folder) = path.parent() {
        fs::create_dir_all(folder)?;
    }
    match fs::remove_file(path) {
        Ok(()) => {}
        Err(error) if error.kind() == io::ErrorKind::NotFound => {}
        Err(error) => return Err(error),
    }
    let listener = UnixListener::bind(path)?;
    fs::set_permissions(path, fs::Permissions::from_mode(0o660))?;
    Ok(listener)
}

fn router(state: ApiState) -> Router {
    let blob_max = usize::try_from(BLOB_BYTES_MAX).unwrap_or(usize::MAX);
    Router::new()
        .route("/v1/status", get(views::status))
        .route("/v1/health", get(views::health))
        .route("/v1/plan", get(views::plan))
        .route("/v1/recording", get(views::recording))
        .route("/v1/deploy", post(deploy::deploy).layer(DefaultBodyLimit::max(SYSTEM_BYTES_MAX)))
        .route("/v1/systems/{name}", delete(deploy::undeploy))
        .route("/v1/reset", post(reset::reset))
        .route("/v1/role/move", post(role::hand_over))
        .route("/v1/role/policy", post(role::set_policy))
        .route("/v1/stop", post(stop::stop))
        .route("/v1/events", get(events::events))
        .route("/v1/logs/{system}/{component}", get(logs::logs))
        .route("/v1/components", get(components::components))
        .route("/v1/keys", post(keys::keys))
        .route("/v1/blobs", post(blobs::keep).layer(DefaultBodyLimit::max(blob_max)))
        .route("/v1/blobs/{hash}", get(blobs::bring))
        .fallback(answer::no_such_path)
        .method_not_allowed_fallback(answer::wrong_method)
        .layer(DefaultBodyLimit::max(BODY_BYTES_MAX))
        .with_state(state)
}

#[cfg(test)]
mod tests;
