//! Which components this robot could run, by asking their executables once.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::process::Stdio;
use std::sync::{Arc, Mutex, PoisonError};
use std::time::{Duration, SystemTime};

use axum::Json;
use axum::extract::State;
use sdr_core::spec::ComponentProfile;
use serde::Serialize;
use tokio::io::AsyncReadExt as _;
use tokio::process::Command;

use super::ApiState;
use crate::supervisor::{executables, find};

/// How long an executable may take to describe itself.
const DESCRIBE_MAX: Duration = Duration::from_secs(5);
/// Longest description, bytes.
const DESCRIPTION_BYTES_MAX: u64 = 256 * 1024;

/// `GET /v1/components`.
#[derive(Debug, Default, Serialize)]
pub(super) struct ComponentsView {
    /// What can be launched and says what it is.
    components: Vec<ComponentProfile>,
    /// What can be launched, but did not describe itself: name and why.
    undescribed: BTreeMap<String, String>,
}

/// Descriptions so far, kept until the executable changes.
#[derive(Clone, Debug)]
pub(crate) struct Profiles {
    folders: Vec<PathBuf>,
    kept: Arc<Mutex<BTreeMap<PathBuf, Kept>>>,
}

#[derive(Clone, Debug)]
struct Kept {
    modified: Option<SystemTime>,
    profile: Result<ComponentProfile, String>,
}

impl Profiles {
    /// Of the executables in `folders`.
    pub(crate) fn new(folders: Vec<PathBuf>) -> Self {
        Self { folders, kept: Arc::default() }
    }

    async fn of(&self, path: PathBuf) -> Result<ComponentProfile, String> {
        let modified = std::fs::metadata(&path).and_then(|found| found.modified()).ok();
        let kept = self.kept.lock().unwrap_or_else(PoisonError::into_inner).get(&path).cloned();
        if let Some(kept) = kept.filter(|kept| kept.modified == modified) {
            return kept.profile;
        }
        let profile = describe(&path).await;
        let kept = Kept { modified, profile: profile.clone() };
        self.kept.lock().unwrap_or_else(PoisonError::into_inner).insert(path, kept);
        profile
    }
}

pub(super) async fn components(State(state): State<ApiState>) -> Json<ComponentsView> {
    let mut view = ComponentsView::default();
    let folders = &state.profiles.folders;
    for name in executables(folders) {
        let Ok(path) = find(folders, &name) else { continue };
        match state.profiles.of(path).await {
            Ok(profile) => view.components.push(profile),
            Err(reason) => {
                view.undescribed.insert(name, reason);
            }
        }
    }
    Json(view)
}

/// Runs `<path> --describe`; its output is the profile as JSON.
async fn describe(path: &Path) -> Result<ComponentProfile, String> {
    let mut child = Command::new(path)
        .arg("--describe")
        .stdin(Stdio::null())
        .stdout(Stdio::piped())
        .stderr(Stdio::null())
        .kill_on_drop(true)
        .spawn()
        .map_err(|error| error.to_string())?;
    let output = child.stdout.take().ok_or("no output")?;
    let mut text = Vec::new();
    let read = async {
        output.take(DESCRIPTION_BYTES_MAX).read_to_end(&mut text).await?;
        child.wait().await
    };
    match tokio::time::timeout(DESCRIBE_MAX, read).await {
        Ok(Ok(status)) if status.success() => {}
        Ok(Ok(status)) => return Err(format!("--describe ended with {status}")),
        Ok(Err(error)) => return Err(error.to_string()),
        Err(_elapsed) => {
            return Err(format!("--describe took more than {} s", DESCRIBE_MAX.as_secs()));
        }
    }
    serde_json::from_slice(&text).map_err(|error| format!("--describe printed no profile: {error}"))
}
