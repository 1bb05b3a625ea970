//! One control group (v2) for each component with limits on memory, CPU or processes.

use std::fs;
use std::io;
use std::path::{Path, PathBuf};

use sdr_core::effect::LaunchOrder;

use super::LimitError;

/// Where control groups of version 2 are mounted.
const MOUNT: &str = "/sys/fs/cgroup";
/// The subgroup that the agent itself runs in: groups with processes have no limited children.
const OWN: &str = "agent";
/// What marks a group as one of a component.
const PREFIX: &str = "c-";
/// Period over which a share of CPU is counted, microseconds.
const CPU_PERIOD_US: u64 = 100_000;

/// The folder below which groups are made.
#[derive(Debug)]
pub(super) struct Groups {
    root: PathBuf,
    held: Held,
}

/// What groups enforce here.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(super) struct Held {
    pub(super) memory: bool,
    pub(super) cpu: bool,
    pub(super) pids: bool,
}

/// The folder that was delegated to this agent, when it runs in a subgroup of that.
pub(super) fn delegated() -> Option<PathBuf> {
    let own = fs::read_to_string("/proc/self/cgroup").ok()?;
    delegated_in(&own, Path::new(MOUNT))
}

fn delegated_in(own: &str, mount: &Path) -> Option<PathBuf> {
    let path = own.lines().find_map(|line| line.strip_prefix("0::/"))?;
    let unit = Path::new(path).parent().filter(|_| Path::new(path).ends_with(OWN))?;
    let root = mount.join(unit);
    root.join("cgroup.controllers").exists().then_some(root)
}

impl Groups {
    /// Hands the controllers that are there to groups below `root`; `None` when none is.
    pub(super) fn open(root: PathBuf) -> Option<Self> {
        let there = fs::read_to_string(root.join("cgroup.controllers")).unwrap_or_default();
        let has = |name: &str| there.split_ascii_whitespace().any(|word| word == name);
        let held = Held { memory: has("memory"), cpu: has("cpu"), pids: has("pids") };
        let wanted = [("memory", held.memory), ("cpu", held.cpu), ("pids", held.pids)];
        let wanted = wanted.iter().filter(|(_, is)| *is).map(|(name, _)| format!("+{name}"));
        let wanted: Vec<String> = wanted.collect();
        let control = root.join("cgroup.subtree_control");
        let refused = match wanted.is_empty() {
            true => Some(io::Error::other("no controller of memory, cpu or pids")),
            false => fs::write(&control, wanted.join(" ")).err(),
        };
        match refused {
            None => Some(Self { root, held }),
            Some(error) => {
                let group = root.display();
                tracing::warn!(event = "no-control-groups", %group, %error, next = "rlimits");
                None
            }
        }
    }

    /// A fresh group for the process of `order`, with its limits, and which of them it holds.
    pub(super) fn make(&self, order: &LaunchOrder) -> Result<(PathBuf, Held), LimitError> {
        let key = &order.component;
        let scope = key.scope.as_ref().map(|robot| format!("@{robot}")).unwrap_or_default();
        let name = format!("{PREFIX}{}.{}{scope}.{}", key.system, key.name, order.instance);
        let group = self.root.join(name);
        let refused = |path: &Path| {
            let path = path.to_path_buf();
            move |source| LimitError::Group { path, source }
        };
        match fs::create_dir(&group) {
            Err(error) if error.kind() != io::ErrorKind::AlreadyExists => {
                return Err(refused(&group)(error));
            }
            Ok(()) | Err(_) => {}
        }
        let limits = &order.spec.limits;
        let memory = limits.memory.filter(|_| self.held.memory).map(|memory| memory.0.to_string());
        let cpu = limits
            .cpu
            .filter(|_| self.held.cpu)
            .map(|share| format!("{} {CPU_PERIOD_US}", u64::from(share.0) * CPU_PERIOD_US / 1000));
        let pids = limits.pids.filter(|_| self.held.pids).map(|pids| pids.to_string());
        let files = [("memory.max", memory), ("cpu.max", cpu), ("pids.max", pids)];
        for (file, value) in files {
            let Some(value) = value else { continue };
            let path = group.join(file);
            fs::write(&path, value).map_err(refused(&path))?;
        }
        if self.held.memory && limits.memory.is_some() {
            // The whole component ends, not one process of it; and it does not swap instead.
            // Older kernels, and those without swap, lack the files.
            let _ = fs::write(group.join("memory.oom.group"), "1");
            let _ = fs::write(group.join("memory.swap.max"), "0");
        }
        Ok((group, self.held))
    }

    /// Removes groups of components in which nothing runs.
    pub(super) fn sweep(&self) {
        let entries = fs::read_dir(&self.root).into_iter().flatten().flatten();
        for entry in entries {
            if entry.file_name().as_encoded_bytes().starts_with(PREFIX.as_bytes()) {
                // One with processes refuses, and stays.
                let _ = fs::remove_dir(entry.path());
            }
        }
    }
}

/// How often the kernel ended a process of the group for want of memory.
pub(super) fn oom_kills(group: &Path) -> u64 {
    let events = fs::read_to_string(group.join("memory.events")).unwrap_or_default();
    let count = events.lines().find_map(|line| line.strip_prefix("oom_kill "));
    count.and_then(|count| count.trim().parse().ok()).unwrap_or(0)
}

/// Ends what is left in it and removes it; what does not end at once is swept by the next agent.
pub(super) fn dissolve(group: &Path) {
    // Before Linux 5.14 there is no such file; the process group was killed already.
    let _ = fs::OpenOptions::new()
        .write(true)
        .open(group.join("cgroup.kill"))
        .and_then(|mut file| io::Write::write_all(&mut file, b"1"));
    if let Err(error) = fs::remove_dir(group) {
        tracing::debug!(event = "group-left", group = %group.display(), %error);
    }
}

#[cfg(test)]
mod tests {
    use sdr_core::units::{Bytes, Permille};

    use super::*;
    use crate::supervisor::tests::order;

    /// A folder with the files of a delegated group.
    fn tree(controllers: &str) -> tempfile::TempDir {
        let dir = tempfile::tempdir().unwrap();
        fs::write(dir.path().join("cgroup.controllers"), controllers).unwrap();
        dir
    }

    #[test]
    fn a_delegated_group_is_found_by_the_agents_own_subgroup() {
        let mount = tempfile::tempdir().unwrap();
        let unit = mount.path().join("system.slice/sdr-agent.service");
        fs::create_dir_all(&unit).unwrap();
        fs::write(unit.join("cgroup.controllers"), "memory").unwrap();
        let within = "1:name=systemd:/x\n0::/system.slice/sdr-agent.service/agent\n";
        assert_eq!(delegated_in(within, mount.path()), Some(unit));
        let beside = "0::/system.slice/sdr-agent.service\n";
        assert_eq!(delegated_in(beside, mount.path()), None);
        assert_eq!(delegated_in("12:memory:/user\n", mount.path()), None);
    }

    #[test]
    fn limits_are_written_into_a_group_of_the_component() {
        let dir = tree("cpuset cpu io memory hugetlb pids\n");
        let groups = Groups::open(dir.path().into()).unwrap();
        let control = fs::read_to_string(dir.path().join("cgroup.subtree_control")).unwrap();
        assert_eq!(control, "+memory +cpu +pids");
        let mut order = order(7, "lidar", Vec::new(), "");
        order.spec.limits.memory = Some(Bytes::mega(800));
        order.spec.limits.cpu = Some(Permille(1500));

        let (group, held) = groups.make(&order).unwrap();

        assert_eq!(held, Held { memory: true, cpu: true, pids: true });
        assert_eq!(group, dir.path().join("c-mapping.lidar.7"));
        let read = |file| fs::read_to_string(group.join(file)).ok();
        assert_eq!(read("memory.max").as_deref(), Some("800000000"));
        assert_eq!(read("cpu.max").as_deref(), Some("150000 100000"));
        assert_eq!(read("pids.max"), None);
        assert_eq!(read("memory.oom.group").as_deref(), Some("1"));
    }

    #[test]
    fn a_tree_without_our_controllers_is_not_used() {
        let dir = tree("hugetlb\n");
        assert!(Groups::open(dir.path().into()).is_none());
        assert!(!dir.path().join("cgroup.subtree_control").exists());
    }

    #[test]
    fn kills_of_the_kernel_are_counted_and_empty_groups_swept() {
        let dir = tree("memory");
        let groups = Groups::open(dir.path().into()).unwrap();
        let (full, empty) = (dir.path().join("c-a.b.1"), dir.path().join("c-a.b.2"));
        fs::create_dir(&full).unwrap();
        fs::create_dir(&empty).unwrap();
        fs::write(full.join("memory.events"), "low 0\noom 3\noom_kill 2\n").unwrap();

        assert_eq!((oom_kills(&full), oom_kills(&empty)), (2, 0));
        groups.sweep();

        assert!(full.exists() && !empty.exists());
    }
}
