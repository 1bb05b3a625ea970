//! Folders of runs that were killed. Their processes and namespaces ended with them.

use std::{
    fs::{self, File},
    path::Path,
};

use rustix::fs::{FlockOperation, flock};

/// Beginning of the names of our folders.
pub(super) const PREFIX: &str = "sdr-lab-";
/// Held as long as the run lives.
const LOCK: &str = "lock";

/// Says that a run lives in `folder`, until the result is dropped.
pub(super) fn hold(folder: &Path) -> std::io::Result<File> {
    let file = File::create(folder.join(LOCK))?;
    flock(&file, FlockOperation::NonBlockingLockExclusive)?;
    Ok(file)
}

/// Removes the folders of dead runs in `parent`; how many there were.
pub(super) fn remove(parent: &Path) -> usize {
    let entries = fs::read_dir(parent).into_iter().flatten().flatten();
    let ours = entries.filter(|entry| entry.file_name().to_string_lossy().starts_with(PREFIX));
    ours.filter(|entry| is_dead(&entry.path()) && fs::remove_dir_all(entry.path()).is_ok()).count()
}

/// Whether nobody holds the folder's lock. One without a lock is just being made, or not ours.
fn is_dead(folder: &Path) -> bool {
    let Ok(file) = File::open(folder.join(LOCK)) else { return false };
    flock(&file, FlockOperation::NonBlockingLockExclusive).is_ok()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn only_folders_of_dead_runs_go() {
        let parent = tempfile::tempdir().unwrap();
        let folder = |name: &str| {
            let path = parent.path().join(name);
            fs::create_dir(&path).unwrap();
            path
        };
        let (living, dead, foreign) = (folder("sdr-lab-a"), folder("sdr-lab-b"), folder("sdr-c"));
        let lock = hold(&living).unwrap();
        drop(hold(&dead).unwrap());

        assert_eq!(remove(parent.path()), 1);

        assert!(living.exists() && !dead.exists() && foreign.exists());
        drop(lock);
    }
}
