//! Native executables: where they are found, how they are started.

use std::fs::{self, File};
use std::io;
use std::os::unix::fs::PermissionsExt as _;
use std::os::unix::process::CommandExt as _;
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Stdio};
use std::time::Duration;

use sdr_component::protocol::{
    ENV_BADGE, ENV_COMPONENT, ENV_INSTANCE, ENV_LEASE_MS, ENV_LOCK_MEMORY, ENV_ORPHAN_MS,
    ENV_SOCKET,
};
use sdr_core::{
    effect::LaunchOrder,
    spec::{ComponentSpec, IsolationAction, Launch, OnAgentDeath},
};
use thiserror::Error;

use super::SupervisorConfig;
use super::keepsake::{self, Place};
use crate::limits::{self, Confinement, LimitError, Limiter};

/// Longest list of executables that a robot announces.
const EXECUTABLES_MAX: usize = 100;
/// How long a component goes on when its agent died and it is to end with it, milliseconds:
/// enough for a broken connection to be made again.
const ORPHAN_MS: &str = "500";
/// How long a component that must not act alone stays active without an agent, at most: its
/// home's lease may be nearly over when the agent dies, and a successor waits 1 s longer.
const LEASE_MAX: Duration = Duration::from_millis(400);

/// Why no process was started. Nothing changed; the operator can mend it.
#[derive(Debug, Error)]
pub(crate) enum LaunchError {
    /// Not a file name.
    #[error("executable `{0}` is not a file name; folders come from [components] path")]
    Name(String),
    /// In none of the folders.
    #[error(
        "executable `{name}` is in none of {}; [components] path of robot.toml names the folders",
        list(folders)
    )]
    Missing {
        /// What was looked for.
        name: String,
        /// Where.
        folders: Vec<PathBuf>,
    },
    /// Its limits.
    #[error("{0}")]
    Limits(#[from] LimitError),
    /// The log of its output.
    #[error("log {}: {source}", path.display())]
    Log {
        /// The file.
        path: PathBuf,
        /// What the system said.
        source: io::Error,
    },
    /// It runs no more: its end could not have been seen.
    #[error("process cannot be watched: {0}")]
    Watch(io::Error),
    /// The system refused.
    #[error("{}: {source}", path.display())]
    Spawn {
        /// The executable.
        path: PathBuf,
        /// What the system said.
        source: io::Error,
    },
}

/// A process that was just started.
#[derive(Debug)]
pub(super) struct Launched {
    pub(super) child: Child,
    pub(super) executable: PathBuf,
    pub(super) place: Place,
}

/// Starts the process of `order` as the leader of its own process group.
pub(super) fn start(
    config: &SupervisorConfig,
    limiter: &Limiter,
    order: &LaunchOrder,
) -> Result<Launched, LaunchError> {
    let Launch::Native { executable: name, arguments } = &order.spec.launch;
    let executable = find(&config.path, name)?;
    let log = config.logs.path_of(&order.component);
    let open = || -> io::Result<(File, File, u64)> {
        let file = File::options().create(true).append(true).open(&log)?;
        let begin = file.metadata()?.len();
        Ok((file.try_clone()?, file, begin))
    };
    let (output, errors, log_begin) =
        open().map_err(|source| LaunchError::Log { path: log.clone(), source })?;
    let badge = keepsake::badge();
    let confinement = limiter.confine(order)?;
    if !confinement.unenforced.is_empty() {
        let (component, what) = (&order.component, confinement.unenforced.join(", "));
        tracing::warn!(event = "limits-unenforced", %component, what, "they need cgroup v2");
    }
    let mut command = confined(&executable, &confinement);
    command
        .args(arguments)
        .env(ENV_SOCKET, &config.socket)
        .env(ENV_COMPONENT, order.component.to_string())
        .env(ENV_INSTANCE, order.instance.to_string())
        .env(ENV_BADGE, &badge)
        .env_remove(ENV_ORPHAN_MS)
        .env_remove(ENV_LEASE_MS)
        .env_remove(ENV_LOCK_MEMORY)
        .current_dir("/")
        .stdin(Stdio::null())
        .stdout(output)
        .stderr(errors)
        .process_group(0);
    match config.on_agent_death_of(&order.spec) {
        OnAgentDeath::Keep => {}
        OnAgentDeath::Stop => {
            command.env(ENV_ORPHAN_MS, ORPHAN_MS);
        }
    }
    if order.spec.limits.lock_memory {
        command.env(ENV_LOCK_MEMORY, "1");
    }
    if let Some(lease) = lease(&order.spec) {
        command.env(ENV_LEASE_MS, lease.as_millis().to_string());
    }
    let child = command
        .spawn()
        .map_err(|source| LaunchError::Spawn { path: executable.clone(), source })?;
    let place = Place {
        badge,
        socket: config.socket.clone(),
        memory: config.memory.clone(),
        log,
        log_begin,
        cgroup: confinement.group,
    };
    Ok(Launched { child, executable, place })
}

/// The program itself, or this one as the helper that limits it first.
fn confined(executable: &Path, confinement: &Confinement) -> Command {
    if confinement.helper.is_empty() {
        return Command::new(executable);
    }
    // Resolved by the child, whose program is this one: also when its file was replaced.
    let mut command = Command::new("/proc/self/exe");
    command.arg(limits::EXEC).args(&confinement.helper).arg("--").arg(executable);
    command
}

/// How long it may stay active without an agent; `None`: as long as it likes.
fn lease(spec: &ComponentSpec) -> Option<Duration> {
    match spec.on_isolation.action {
        IsolationAction::Deactivate => Some(spec.on_isolation.after.min(LEASE_MAX)),
        IsolationAction::Continue => None,
    }
}

/// The first executable of that name.
pub(crate) fn find(folders: &[PathBuf], name: &str) -> Result<PathBuf, LaunchError> {
    if name.is_empty() || name.contains('/') || name.starts_with('.') {
        return Err(LaunchError::Name(name.to_string()));
    }
    let found = folders.iter().map(|folder| folder.join(name)).find(|path| is_executable(path));
    found.ok_or_else(|| LaunchError::Missing { name: name.into(), folders: folders.to_vec() })
}

/// Names of all executables that can be launched, sorted, at most [`EXECUTABLES_MAX`]: what
/// has a dot in its name is a library or a build's by-product, what begins with `sdr` is ours.
pub(crate) fn executables(folders: &[PathBuf]) -> Vec<String> {
    let mut names = Vec::new();
    for folder in folders {
        let Ok(entries) = fs::read_dir(folder) else {
            tracing::warn!(event = "component-folder-unreadable", folder = %folder.display());
            continue;
        };
        for entry in entries.flatten() {
            let Ok(name) = entry.file_name().into_string() else { continue };
            if !name.contains('.') && !name.starts_with("sdr") && is_executable(&entry.path()) {
                names.push(name);
            }
        }
    }
    names.sort();
    names.dedup();
    if names.len() > EXECUTABLES_MAX {
        let found = names.len();
        tracing::warn!(event = "too-many-executables", found, announced = EXECUTABLES_MAX);
        names.truncate(EXECUTABLES_MAX);
    }
    names
}

fn is_executable(path: &Path) -> bool {
    fs::metadata(path).is_ok_and(|found| found.is_file() && found.permissions().mode() & 0o111 != 0)
}

fn list(folders: &[PathBuf]) -> String {
    let words: Vec<String> = folders.iter().map(|folder| folder.display().to_string()).collect();
    words.join(", ")
}
