//! Limits of components: control groups where there are some, rlimits else.
//!
//! ```text
//!   spec.limits ─▶ Limiter::confine ─▶ Confinement: a group, words for the helper
//!                                           │
//!   sdr-agent exec WORDS -- PROGRAM ◀───────┘   joins the group, sets the rest, becomes PROGRAM
//! ```
//!
//! The helper is this very program, between fork and exec of the component: there it may
//! allocate, and what goes wrong has a name.

mod exec;
mod group;
mod oom;

use std::ffi::OsString;
use std::path::PathBuf;

use sdr_core::{effect::LaunchOrder, spec::Limits};
use sdr_files::robot::Cgroup;
use thiserror::Error;

pub(crate) use exec::{WORD as EXEC, run as exec};
use group::Groups;
pub(crate) use oom::{OomWatch, says_refused};

/// Why a component cannot be limited as wished, and so does not start.
#[derive(Debug, Error)]
pub(crate) enum LimitError {
    /// Its group was refused.
    #[error("control group {}: {source}", path.display())]
    Group {
        /// What was written or made.
        path: PathBuf,
        /// What the system said.
        source: std::io::Error,
    },
}

/// What enforces limits on this robot.
#[derive(Debug)]
pub(crate) struct Limiter {
    groups: Option<Groups>,
}

/// How one process is held to its limits.
#[derive(Debug, Default)]
pub(crate) struct Confinement {
    /// Words for the helper; none when it is not needed.
    pub(crate) helper: Vec<OsString>,
    /// Its group.
    pub(crate) group: Option<PathBuf>,
    /// What this robot cannot enforce.
    pub(crate) unenforced: Vec<&'static str>,
}

impl Limiter {
    /// As `[components] cgroup` of robot.toml says.
    pub(crate) fn open(cgroup: &Cgroup) -> Self {
        let groups = match cgroup {
            Cgroup::Off => None,
            Cgroup::Auto => group::delegated().and_then(Groups::open),
            Cgroup::Below(folder) => Groups::open(folder.clone()),
        };
        if let Some(groups) = &groups {
            groups.sweep();
        }
        Self { groups }
    }

    /// Makes what the process of `order` is to be started with.
    pub(crate) fn confine(&self, order: &LaunchOrder) -> Result<Confinement, LimitError> {
        let limits = &order.spec.limits;
        if limits.is_none() {
            return Ok(Confinement::default());
        }
        let mut confinement = Confinement::default();
        let grouped = [limits.memory.is_some(), limits.cpu.is_some(), limits.pids.is_some()];
        let mut held = group::Held::default();
        if let Some(groups) = self.groups.as_ref().filter(|_| grouped.contains(&true)) {
            let (group, enforced) = groups.make(order)?;
            confinement.helper.extend(["--group".into(), group.clone().into_os_string()]);
            confinement.group = Some(group);
            held = enforced;
        }
        let mut word = |name: &str, value: String| {
            confinement.helper.push(name.into());
            confinement.helper.push(value.into());
        };
        if let Some(memory) = limits.memory.filter(|_| !held.memory) {
            word("--data", memory.0.to_string());
        }
        if let Some(nice) = limits.nice {
            word("--nice", nice.to_string());
        }
        if let Some(priority) = limits.fifo {
            word("--fifo", priority.to_string());
        }
        if !limits.cores.is_empty() {
            let cores: Vec<String> = limits.cores.iter().map(ToString::to_string).collect();
            word("--cores", cores.join(","));
        }
        if limits.lock_memory {
            confinement.helper.push("--lock".into());
        }
        confinement.unenforced = unenforced(limits, held);
        Ok(confinement)
    }
}

/// rlimits have no share of a core, and count processes by user.
fn unenforced(limits: &Limits, held: group::Held) -> Vec<&'static str> {
    let cpu = limits.cpu.filter(|_| !held.cpu).map(|_| "cpu");
    let pids = limits.pids.filter(|_| !held.pids).map(|_| "pids");
    cpu.into_iter().chain(pids).collect()
}

/// Whether the group of a process that ended saw the kernel end one of it for want of memory.
pub(crate) fn was_out_of_memory(group: &std::path::Path) -> bool {
    group::oom_kills(group) > 0
}

/// Ends what is left in a group and removes it.
pub(crate) fn dissolve(group: &std::path::Path) {
    group::dissolve(group);
}

#[cfg(test)]
mod tests;
