//! Output of components: one file each, bounded, with one older part beside it.
//!
//! Components write to their file themselves, so that they lose nothing and need nobody
//! when their agent is gone.

use std::fs::{self, File};
use std::io::{self, Read as _, Seek as _, SeekFrom};
use std::path::{Path, PathBuf};
use std::rc::Weak;
use std::time::{Duration, SystemTime};

use sdr_core::id::ComponentKey;

use super::Shared;

/// Time between two looks at the sizes.
const LOOK_PERIOD: Duration = Duration::from_secs(1);
/// How much of a file's end is searched for lines, bytes for each line asked for.
const LINE_BYTES: u64 = 512;

/// Where output goes, and how much of it is kept.
#[derive(Clone, Debug)]
pub(crate) struct LogFiles {
    /// The folder.
    pub(crate) dir: PathBuf,
    /// Bytes of one component, both parts together.
    pub(crate) each_bytes_max: u64,
    /// Bytes of all components.
    pub(crate) bytes_max: u64,
}

impl LogFiles {
    /// The file of one component.
    pub(crate) fn path_of(&self, component: &ComponentKey) -> PathBuf {
        let scope = component.scope.as_ref().map(|robot| format!("@{robot}")).unwrap_or_default();
        self.dir.join(format!("{}.{}{scope}.log", component.system, component.name))
    }

    /// Brings the folder back within its bounds.
    fn bound(&self) -> io::Result<()> {
        let mut files = Vec::new();
        for entry in fs::read_dir(&self.dir)?.flatten() {
            let (path, found) = (entry.path(), entry.metadata()?);
            if path.extension().is_some_and(|word| word == "log")
                && found.len() > self.each_bytes_max / 2
            {
                turn(&path)?;
            }
            files.push((found.modified().unwrap_or(SystemTime::UNIX_EPOCH), found.len(), path));
        }
        // The longest silent go first; what is being written is truncated, not removed.
        files.sort();
        let mut sum: u64 = files.iter().map(|(_, length, _)| length).sum();
        for (_, length, path) in files {
            if sum <= self.bytes_max {
                break;
            }
            File::options().write(true).open(path)?.set_len(0)?;
            sum -= length;
        }
        Ok(())
    }
}

/// Copies a file to its older part and empties it: its writers append, so they go on at zero.
fn turn(path: &Path) -> io::Result<()> {
    fs::copy(path, path.with_extension("log.1"))?;
    File::options().write(true).open(path)?.set_len(0)
}

/// Keeps the folder within its bounds as long as the supervisor lives.
pub(super) async fn bound(shared: Weak<Shared>) {
    loop {
        tokio::time::sleep(LOOK_PERIOD).await;
        let Some(shared) = shared.upgrade() else { return };
        shared.oom.look();
        if let Err(error) = shared.config.logs.bound() {
            let dir = shared.config.logs.dir.display();
            tracing::debug!(event = "logs-unbounded", %dir, %error);
        }
    }
}

/// The last `count` lines at or behind `begin`, and where the file ends.
pub(crate) fn lines_at_end(path: &Path, begin: u64, count: usize) -> io::Result<(String, u64)> {
    let mut file = File::open(path)?;
    let end = file.metadata()?.len();
    // Emptied meanwhile: everything in it is new.
    let begin = if begin > end { 0 } else { begin };
    let searched = (count as u64).saturating_mul(LINE_BYTES).max(8192);
    let from = begin.max(end.saturating_sub(searched));
    file.seek(SeekFrom::Start(from))?;
    let mut bytes = Vec::new();
    file.take(end - from).read_to_end(&mut bytes)?;
    let text = String::from_utf8_lossy(&bytes);
    let lines: Vec<&str> = text.lines().collect();
    let first = lines.len().saturating_sub(count);
    let mut last = lines[first..].join("\n");
    if !last.is_empty() && text.ends_with('\n') {
        last.push('\n');
    }
    Ok((last, end))
}

#[cfg(test)]
mod tests {
    use std::io::Write as _;

    use super::*;

    #[test]
    fn the_last_lines_are_those_of_this_process() {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("a.log");
        fs::write(&path, "of the one before\n1\n2\n3\n").unwrap();

        assert_eq!(lines_at_end(&path, 18, 2).unwrap().0, "2\n3\n");
        assert_eq!(lines_at_end(&path, 18, 9).unwrap().0, "1\n2\n3\n");
        assert_eq!(lines_at_end(&path, 24, 9).unwrap(), (String::new(), 24));
        assert_eq!(lines_at_end(&path, 9999, 1).unwrap().0, "3\n");
    }

    #[test]
    fn a_log_that_grows_too_large_keeps_its_older_part_and_its_writer() {
        let dir = tempfile::tempdir().unwrap();
        let logs = LogFiles { dir: dir.path().into(), each_bytes_max: 2000, bytes_max: 1_000_000 };
        let path = dir.path().join("s.c.log");
        let mut writer = File::options().create(true).append(true).open(&path).unwrap();
        writer.write_all(&[b'x'; 1500]).unwrap();

        logs.bound().unwrap();
        writer.write_all(b"later\n").unwrap();

        assert_eq!(fs::read_to_string(&path).unwrap(), "later\n");
        assert_eq!(fs::metadata(dir.path().join("s.c.log.1")).unwrap().len(), 1500);
    }

    #[test]
    fn all_logs_together_stay_within_their_bound() {
        let dir = tempfile::tempdir().unwrap();
        let logs = LogFiles { dir: dir.path().into(), each_bytes_max: 1_000_000, bytes_max: 2500 };
        for name in ["a.log", "b.log", "c.log"] {
            fs::write(dir.path().join(name), [b'x'; 1000]).unwrap();
        }

        logs.bound().unwrap();

        let sum: u64 =
            fs::read_dir(dir.path()).unwrap().map(|e| e.unwrap().metadata().unwrap().len()).sum();
        assert_eq!(sum, 2000);
    }
}
