//! Native executables: where they are found, how they are started.

use std::fs::{self, File};
use std::io;
use std::os::unix::fs::PermissionsExt as _;
use std::os::unix::process::CommandExt as _;
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Stdio};

use sdr_component::protocol::{ENV_COMPONENT, ENV_INSTANCE, ENV_ORPHAN_MS, ENV_SOCKET};
use sdr_core::{effect::LaunchOrder, spec::Launch};
use sdr_files::robot::OnAgentDeath;
use thiserror::Error;

use super::SupervisorConfig;

/// Longest list of executables that a robot announces.
const EXECUTABLES_MAX: usize = 100;
/// How long a component goes on when its agent died and it is to end with it, milliseconds:
/// enough for a broken connection to be made again.
const ORPHAN_MS: &str = "500";

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
    pub(super) log: PathBuf,
    /// Length of the log before this process wrote to it.
    pub(super) log_begin: u64,
}

/// Starts the process of `order` as the leader of its own process group.
pub(super) fn start(
    config: &SupervisorConfig,
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
    let mut command = Command::new(&executable);
    command
        .args(arguments)
        .env(ENV_SOCKET, &config.socket)
        .env(ENV_COMPONENT, order.component.to_string())
        .env(ENV_INSTANCE, order.instance.to_string())
        .env_remove(ENV_ORPHAN_MS)
        .current_dir("/")
        .stdin(Stdio::null())
        .stdout(output)
        .stderr(errors)
        .process_group(0);
    match config.on_agent_death {
        OnAgentDeath::Keep => {}
        OnAgentDeath::Stop => {
            command.env(ENV_ORPHAN_MS, ORPHAN_MS);
        }
    }
    let child = command
        .spawn()
        .map_err(|source| LaunchError::Spawn { path: executable.clone(), source })?;
    Ok(Launched { child, executable, log, log_begin })
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
