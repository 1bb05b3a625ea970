//! Which components this robot could run, by asking their executables once.

use std::collections::BTreeMap;
use std::io;
use std::path::{Path, PathBuf};
use std::process::Stdio;
use std::sync::{Arc, Mutex, PoisonError};
use std::time::{Duration, SystemTime};

use axum::Json;
use axum::extract::State;
use rustix::process::{Pid, Signal, kill_process_group};
use sdr_core::spec::ComponentProfile;
use serde::Serialize;
use tokio::io::AsyncReadExt as _;
use tokio::process::{Child, Command};

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

/// A program and all it started; killed when it is dropped before the program ended.
#[derive(Debug)]
struct Group(Option<Pid>);

impl Group {
    /// Of a child that leads a group of its own.
    fn of(child: &Child) -> Self {
        let pid = child.id().and_then(|pid| i32::try_from(pid).ok());
        Self(pid.and_then(Pid::from_raw))
    }

    /// From now on its number may be another's.
    fn ended(&mut self) {
        self.0 = None;
    }
}

impl Drop for Group {
    fn drop(&mut self) {
        if let Some(leader) = self.0 {
            // It may have ended this very moment.
            let _ = kill_process_group(leader, Signal::KILL);
        }
    }
}

/// Runs `<path> --describe`; its output is the profile as JSON.
async fn describe(path: &Path) -> Result<ComponentProfile, String> {
    let mut child = Command::new(path)
        .arg("--describe")
        .stdin(Stdio::null())
        .stdout(Stdio::piped())
        .stderr(Stdio::null())
        .process_group(0)
        .kill_on_drop(true)
        .spawn()
        .map_err(|error| error.to_string())?;
    let mut group = Group::of(&child);
    let output = child.stdout.take().ok_or("no output")?;
    let mut text = Vec::new();
    let read = async {
        output.take(DESCRIPTION_BYTES_MAX).read_to_end(&mut text).await?;
        let status = child.wait().await?;
        group.ended();
        io::Result::Ok(status)
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

#[cfg(test)]
mod tests {
    use std::fs;
    use std::os::unix::fs::PermissionsExt as _;

    use super::*;

    const PATIENCE: Duration = Duration::from_secs(30);

    /// Whether a process is there and not only its exit status.
    fn runs(pid: &str) -> bool {
        let stat = fs::read_to_string(format!("/proc/{pid}/stat")).unwrap_or_default();
        stat.rsplit(')').next().is_some_and(|rest| !rest.is_empty() && !rest.starts_with(" Z"))
    }

    async fn until(what: &str, holds: impl Fn() -> bool) {
        let waited = async {
            while !holds() {
                tokio::time::sleep(Duration::from_millis(5)).await;
            }
        };
        let done = tokio::time::timeout(PATIENCE, waited).await;
        assert!(done.is_ok(), "waited for {what}");
    }

    #[tokio::test]
    async fn what_a_hanging_program_started_ends_with_the_question() {
        let folder = tempfile::tempdir().unwrap();
        let (program, noted) = (folder.path().join("hangs"), folder.path().join("pid"));
        let script = format!("#!/bin/sh\nsleep 600 &\necho $! > {}\nwait\n", noted.display());
        fs::write(&program, script).unwrap();
        fs::set_permissions(&program, fs::Permissions::from_mode(0o755)).unwrap();
        let pid = || fs::read_to_string(&noted).unwrap_or_default().trim().to_owned();

        tokio::select! {
            answer = describe(&program) => panic!("{answer:?}"),
            () = until("its child", || !pid().is_empty()) => {}
        }

        until("its child to end", || !runs(&pid())).await;
    }
}
