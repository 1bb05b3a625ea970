//! The demo's temporary folder.

use std::{
    fs::{self, File},
    io,
    path::{Path, PathBuf},
    time::Duration,
};

use rustix::fs::{FlockOperation, flock};
use tempfile::TempDir;

use crate::failure::Failure;

/// Longest path of the folder, bytes, so that sockets below it have short enough names.
const PATH_BYTES_MAX: usize = 70;
/// How often the removal is tried.
const TRIES_MAX: u32 = 40;
/// Pause between two tries.
const TRY_EVERY: Duration = Duration::from_millis(25);

/// What the names of all such folders begin with.
const PREFIX: &str = "sdr-";
/// Locked as long as the demo lives, however it dies.
const LOCK: &str = "demo.lock";

/// An empty temporary folder with a short path, removed when dropped. Whoever writes in it must
/// have ended before.
pub(crate) struct Folder {
    folder: Option<TempDir>,
    path: PathBuf,
    _lock: File,
}

impl Folder {
    /// Makes it; its name begins with `prefix`.
    pub(crate) fn new(prefix: &str) -> Result<Self, Failure> {
        let parent = std::env::temp_dir();
        let long = parent.as_os_str().len() + "/123456".len() + prefix.len() > PATH_BYTES_MAX;
        let parent = if long { PathBuf::from("/tmp") } else { parent };
        remove_orphans(&parent);
        let tell = |error: io::Error| {
            Failure::new(format!("cannot make a folder in {}: {error}", parent.display()))
        };
        let folder = tempfile::Builder::new().prefix(prefix).tempdir_in(&parent).map_err(tell)?;
        let lock = hold(folder.path()).map_err(tell)?;
        Ok(Self { path: folder.path().to_owned(), folder: Some(folder), _lock: lock })
    }

    /// Where it is.
    pub(crate) fn path(&self) -> &Path {
        &self.path
    }
}

impl Drop for Folder {
    /// Tries again for a while: a process that was just killed may still have had a file to make.
    fn drop(&mut self) {
        drop(self.folder.take());
        for _ in 0..TRIES_MAX {
            if !self.path.exists() {
                return;
            }
            std::thread::sleep(TRY_EVERY);
            let _ = fs::remove_dir_all(&self.path);
        }
    }
}

/// The lock of a folder; it gets its name when it is held, so that nobody finds it free.
fn hold(folder: &Path) -> io::Result<File> {
    let unnamed = folder.join("lock");
    let lock = File::create(&unnamed)?;
    flock(&lock, FlockOperation::NonBlockingLockExclusive)?;
    fs::rename(&unnamed, folder.join(LOCK))?;
    Ok(lock)
}

/// Removes the folders of demos that were killed; theirs are the locks that nobody holds.
fn remove_orphans(parent: &Path) {
    let entries = fs::read_dir(parent).into_iter().flatten().flatten();
    for entry in entries.filter(|entry| entry.file_name().to_string_lossy().starts_with(PREFIX)) {
        let Ok(lock) = File::open(entry.path().join(LOCK)) else { continue };
        if flock(&lock, FlockOperation::NonBlockingLockExclusive).is_ok() {
            // Another demo may be at it, or it is another user's.
            let _ = fs::remove_dir_all(entry.path());
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn it_goes_with_all_that_is_in_it() {
        let folder = Folder::new("sdr-").unwrap();
        let path = folder.path().to_owned();
        fs::create_dir_all(path.join("w/robot-1")).unwrap();
        fs::write(path.join("w/robot-1/wireless"), "x").unwrap();
        drop(folder);
        assert!(!path.exists());
    }

    #[test]
    fn what_a_killed_demo_left_goes_and_what_is_in_use_stays() {
        let parent = tempfile::tempdir().unwrap();
        let (orphan, used) = (parent.path().join("sdr-aaaaaa"), parent.path().join("sdr-bbbbbb"));
        for folder in [&orphan, &used] {
            fs::create_dir(folder).unwrap();
            fs::write(folder.join(LOCK), "").unwrap();
        }
        fs::create_dir(parent.path().join("sdr-of-others")).unwrap();
        let held = File::open(used.join(LOCK)).unwrap();
        flock(&held, FlockOperation::NonBlockingLockExclusive).unwrap();

        remove_orphans(parent.path());

        assert!(!orphan.exists() && used.exists());
        assert!(parent.path().join("sdr-of-others").exists());
    }

    #[test]
    fn sockets_in_it_have_short_enough_names() {
        let folder = Folder::new("sdr-").unwrap();
        let longest = folder.path().join("w/robot-3/fisheye.sock");
        assert!(longest.as_os_str().len() <= 107, "{}", longest.display());
        let longest = folder.path().join("3/a.components.sock");
        assert!(longest.as_os_str().len() <= 107, "{}", longest.display());
    }
}
