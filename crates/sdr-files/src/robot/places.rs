//! Where things are when robot.toml does not say.

use std::{
    env, fs,
    os::unix::fs::MetadataExt,
    path::{Path, PathBuf},
};

/// The world around robot.toml: default folders, the user's home, the host's name.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Places {
    /// Folder that relative paths count from.
    pub folder: PathBuf,
    /// What `~` means, when there is a home.
    pub home: Option<PathBuf>,
    /// Name of the machine.
    pub host_name: String,
    /// What is kept: /var/lib/sdr, or XDG's state folder.
    pub state: PathBuf,
    /// Sockets: /run/sdr, or XDG's runtime folder.
    pub run: PathBuf,
}

impl Places {
    /// /etc/sdr, /var/lib/sdr, /run/sdr for root; the XDG folders for everybody else.
    pub fn of_this_process() -> Self {
        let home = env::var_os("HOME").map(PathBuf::from);
        let root = fs::metadata("/proc/self").is_ok_and(|own| own.uid() == 0);
        let host_name = fs::read_to_string("/proc/sys/kernel/hostname").unwrap_or_default();
        let (folder, state, run) = if root {
            ("/etc/sdr".into(), "/var/lib/sdr".into(), "/run/sdr".into())
        } else {
            let below_home = |part: &str| home.as_deref().unwrap_or(Path::new("/tmp")).join(part);
            let xdg = |name: &str| env::var_os(name).map(PathBuf::from).filter(|p| p.is_absolute());
            let config = xdg("XDG_CONFIG_HOME").unwrap_or_else(|| below_home(".config"));
            let state = xdg("XDG_STATE_HOME").unwrap_or_else(|| below_home(".local/state"));
            let run = xdg("XDG_RUNTIME_DIR").unwrap_or_else(|| state.join("run"));
            (config.join("sdr"), state.join("sdr"), run.join("sdr"))
        };
        Self { folder, home, host_name: host_name.trim().to_owned(), state, run }
    }

    /// Where robot.toml is looked for when nobody names one.
    pub fn robot_file(&self) -> PathBuf {
        self.folder.join("robot.toml")
    }

    /// `text` as a path: `~/` from the home, relative ones from the folder.
    pub fn resolve(&self, text: &str) -> PathBuf {
        match (text.strip_prefix("~/"), &self.home) {
            (Some(rest), Some(home)) => home.join(rest),
            (Some(_) | None, _) => self.folder.join(text),
        }
    }
}
