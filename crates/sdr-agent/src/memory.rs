//! The robot's names in shared memory: cleaned when nobody can be using them.

use std::fs;
use std::io;
use std::path::Path;

use sdr_component::protocol::SharedMemory;

/// Where POSIX shared memory lies on Linux.
const SHM: &str = "/dev/shm";

/// Removes all shared memory of this robot. Only for when none of its processes runs.
pub(crate) fn clean(memory: &SharedMemory) {
    let removed =
        remove_prefixed(Path::new(SHM), &memory.prefix).and_then(|()| remove_folder(&memory.root));
    if let Err(error) = removed {
        let prefix = &memory.prefix;
        tracing::warn!(event = "shared-memory-left", prefix, %error, next = "go on");
    }
    // The folder above is shared by all robots of the machine; only the last one removes it.
    if let Some(all) = memory.root.parent() {
        let _ = fs::remove_dir(all);
    }
}

fn remove_prefixed(dir: &Path, prefix: &str) -> io::Result<()> {
    for entry in fs::read_dir(dir)? {
        let entry = entry?;
        if entry.file_name().as_encoded_bytes().starts_with(prefix.as_bytes()) {
            ignore_missing(fs::remove_file(entry.path()))?;
        }
    }
    Ok(())
}

fn remove_folder(root: &Path) -> io::Result<()> {
    ignore_missing(fs::remove_dir_all(root))
}

fn ignore_missing(result: io::Result<()>) -> io::Result<()> {
    match result {
        Err(error) if error.kind() == io::ErrorKind::NotFound => Ok(()),
        other => other,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn only_names_with_the_prefix_go() {
        let dir = tempfile::tempdir().unwrap();
        for name in ["s01234567_a", "s01234567_b", "s01234568_a", "other"] {
            fs::write(dir.path().join(name), "").unwrap();
        }

        remove_prefixed(dir.path(), "s01234567_").unwrap();

        let mut left: Vec<_> =
            fs::read_dir(dir.path()).unwrap().map(|entry| entry.unwrap().file_name()).collect();
        left.sort();
        assert_eq!(left, ["other", "s01234568_a"]);
    }

    #[test]
    fn a_folder_that_was_never_made_is_no_error() {
        remove_folder(Path::new("/dev/shm/sdr-never-made/at-all")).unwrap();
    }
}
