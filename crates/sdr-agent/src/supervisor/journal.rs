//! Which processes run, on disk, so that the next agent finds what this one left.

use std::cell::RefCell;
use std::collections::BTreeMap;
use std::fs;
use std::io;
use std::path::{Path, PathBuf};

use sdr_core::input::InstanceId;
use serde::{Deserialize, Serialize};

use super::keepsake::Keepsake;
use crate::metrics::process::parse_start_time;
use crate::store;

const FILE_NAME: &str = "processes.json";

/// One process, named so that it cannot be mistaken for another.
///
/// Fields are only appended: agents of the versions before and after read this list too.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub(super) struct Entry {
    /// The component's key.
    pub(super) component: String,
    /// The instance it was.
    pub(super) instance: InstanceId,
    /// Its process, leader of its group.
    pub(super) pid: u32,
    /// When it started, ticks after boot.
    pub(super) start_time: u64,
    /// Of which boot.
    pub(super) boot_id: String,
    /// What it runs.
    pub(super) executable: PathBuf,
    /// A [`Keepsake`], kept as it stands so that an unknown one costs only the adoption; none
    /// in lists of agents that did not adopt.
    #[serde(default)]
    pub(super) keepsake: serde_json::Value,
}

/// The list on disk: replaced as a whole at each start and end. It need not survive a
/// reboot, so nothing waits for the disk.
#[derive(Debug)]
pub(super) struct Journal {
    path: PathBuf,
    boot_id: String,
    entries: RefCell<BTreeMap<InstanceId, Entry>>,
}

impl Journal {
    /// An empty journal in `dir`; written with the first process.
    pub(super) fn new(dir: &Path) -> Self {
        Self { path: dir.join(FILE_NAME), boot_id: boot_id(), entries: RefCell::default() }
    }

    /// Where it lies.
    pub(super) fn path(&self) -> &Path {
        &self.path
    }

    /// A process was started.
    pub(super) fn add(&self, instance: InstanceId, pid: u32, program: &Path, keepsake: &Keepsake) {
        let entry = Entry {
            component: keepsake.component.to_string(),
            instance,
            pid,
            start_time: start_time(pid).unwrap_or(0),
            boot_id: self.boot_id.clone(),
            executable: program.into(),
            keepsake: serde_json::to_value(keepsake).unwrap_or_default(),
        };
        self.entries.borrow_mut().insert(instance, entry);
        self.write();
    }

    /// Whether no process is left.
    pub(super) fn is_empty(&self) -> bool {
        self.entries.borrow().is_empty()
    }

    /// A process was reaped.
    pub(super) fn remove(&self, instance: InstanceId) {
        self.entries.borrow_mut().remove(&instance);
        self.write();
    }

    fn write(&self) {
        let entries: Vec<Entry> = self.entries.borrow().values().cloned().collect();
        if let Err(error) = write(&self.path, &entries) {
            let path = self.path.display();
            tracing::error!(event = "journal-unwritten", %path, %error, next = "go on without");
        }
    }
}

/// What a predecessor left.
#[derive(Debug, Default)]
pub(super) struct Left {
    /// As far as it can be read.
    pub(super) entries: Vec<Entry>,
    /// What is wrong with its list, and where the list was put aside.
    pub(super) trouble: Option<String>,
}

/// What the predecessor left in `dir`; nothing when it left no list.
pub(super) fn read(dir: &Path) -> Left {
    let path = dir.join(FILE_NAME);
    let text = match fs::read(&path) {
        Ok(text) => text,
        Err(error) if error.kind() == io::ErrorKind::NotFound => return Left::default(),
        Err(error) => {
            let trouble = Some(format!("{}: {error}", path.display()));
            return Left { entries: Vec::new(), trouble };
        }
    };
    let (entries, wrong) = parse(&text);
    let trouble = wrong.map(|wrong| match store::set_aside(&path) {
        Ok(kept) => format!("{wrong}; kept as {}", kept.display()),
        Err(error) => format!("{wrong}; {} could not be kept: {error}", path.display()),
    });
    Left { entries, trouble }
}

/// The entries that can be read, and what is wrong with the others.
fn parse(text: &[u8]) -> (Vec<Entry>, Option<String>) {
    let values: Vec<serde_json::Value> = match serde_json::from_slice(text) {
        Ok(values) => values,
        Err(error) => return (Vec::new(), Some(format!("no list of processes: {error}"))),
    };
    let (mut entries, mut wrong) = (Vec::new(), None);
    for (number, value) in values.into_iter().enumerate() {
        match serde_json::from_value(value) {
            Ok(entry) => entries.push(entry),
            Err(error) => wrong = Some(format!("entry {}: {error}", number + 1)),
        }
    }
    (entries, wrong)
}

fn write(path: &Path, entries: &[Entry]) -> io::Result<()> {
    let temporary = path.with_extension("new");
    fs::write(&temporary, serde_json::to_vec_pretty(entries)?)?;
    fs::rename(temporary, path)
}

/// When `pid` started, ticks after boot; `None` when it is gone.
pub(super) fn start_time(pid: u32) -> Option<u64> {
    parse_start_time(&fs::read_to_string(format!("/proc/{pid}/stat")).ok()?)
}

/// Differs from boot to boot.
pub(super) fn boot_id() -> String {
    let id = fs::read_to_string("/proc/sys/kernel/random/boot_id").unwrap_or_default();
    id.trim().to_string()
}
