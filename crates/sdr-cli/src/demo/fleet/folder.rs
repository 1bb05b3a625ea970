//! The demo's temporary folder.

use std::{
    fs,
    path::{Path, PathBuf},
    time::Duration,
};

use tempfile::TempDir;

use crate::failure::Failure;

/// Longest path of the folder, bytes, so that sockets below it have short enough names.
const PATH_BYTES_MAX: usize = 70;
/// How often the removal is tried.
const TRIES_MAX: u32 = 40;
/// Pause between two tries.
const TRY_EVERY: Duration = Duration::from_millis(25);

/// An empty temporary folder with a short path, removed when dropped. Whoever writes in it must
/// have ended before.
pub(crate) struct Folder {
    folder: Option<TempDir>,
    path: PathBuf,
}

impl Folder {
    /// Makes it; its name begins with `prefix`.
    pub(crate) fn new(prefix: &str) -> Result<Self, Failure> {
        let parent = std::env::temp_dir();
        let long = parent.as_os_str().len() + "/123456".len() + prefix.len() > PATH_BYTES_MAX;
        let parent = if long { PathBuf::from("/tmp") } else { parent };
        let folder = tempfile::Builder::new().prefix(prefix).tempdir_in(&parent);
        let folder = folder.map_err(|error| {
            Failure::new(format!("cannot make a folder in {}: {error}", parent.display()))
        })?;
        Ok(Self { path: folder.path().to_owned(), folder: Some(folder) })
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
    fn sockets_in_it_have_short_enough_names() {
        let folder = Folder::new("sdr-").unwrap();
        let longest = folder.path().join("w/robot-3/fisheye.sock");
        assert!(longest.as_os_str().len() <= 107, "{}", longest.display());
        let longest = folder.path().join("3/a.components.sock");
        assert!(longest.as_os_str().len() <= 107, "{}", longest.display());
    }
}
