//! For the tests of this crate: a robot of its own for each.

use crate::protocol::SharedMemory;

/// A place in shared memory; everything is gone afterwards.
pub(crate) struct Place {
    pub(crate) memory: SharedMemory,
    _folder: tempfile::TempDir,
}

impl Place {
    pub(crate) fn new() -> Self {
        let folder = tempfile::tempdir_in("/dev/shm").unwrap();
        let word = folder.path().file_name().unwrap().to_str().unwrap().replace(".tmp", "");
        let memory = SharedMemory { prefix: format!("t{word}_"), root: folder.path().to_owned() };
        Self { memory, _folder: folder }
    }
}

impl Drop for Place {
    fn drop(&mut self) {
        for entry in std::fs::read_dir("/dev/shm").unwrap().flatten() {
            if entry.file_name().to_string_lossy().starts_with(&self.memory.prefix) {
                let _ = std::fs::remove_file(entry.path());
            }
        }
    }
}
