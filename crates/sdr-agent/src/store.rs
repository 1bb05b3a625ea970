//! What the brain must not forget, on disk: replaced as a whole, checked when read. The brain
//! orders what changed; the writer holds the whole, whose facts are the brain's own.
//!
//! ```text
//!  "SDRSTATE" | version u32 | checksum u64 of the rest | StoredState in postcard
//! ```

use std::fs::{self, File};
use std::io::{self, Write as _};
use std::path::{Path, PathBuf};
use std::sync::{Arc, Condvar, Mutex, PoisonError};
use std::thread::{self, JoinHandle};

use sdr_core::{
    effect::{StoredChange, StoredState},
    input::{Input, StoreTicket},
    order::hash64,
};
use thiserror::Error;
use tokio::sync::mpsc;

use crate::events::Events;

const MAGIC: &[u8; 8] = b"SDRSTATE";
const VERSION: u32 = 1;
const HEADER_BYTES: usize = 20;
/// Lists at the end of the state that the first builds of this version did not write.
const LISTS_APPENDED: usize = 2;
const FILE_NAME: &str = "state";

/// What the disk held at the start.
#[derive(Debug)]
pub(crate) enum Remembered {
    /// Nothing: a new robot, or one with a new disk.
    Nothing,
    /// The state as it was stored last.
    State(StoredState),
    /// Bytes that are not a state; they lie at `set_aside` now.
    Corrupt {
        /// Where they were put.
        set_aside: PathBuf,
        /// What is wrong with them.
        reason: StateError,
    },
}

/// Why bytes are not a state. Nothing was changed; the operator may look at the file.
#[derive(Debug, Error)]
pub(crate) enum StateError {
    /// Not written by an agent.
    #[error("{found} bytes that do not begin with the state's mark")]
    Foreign {
        /// Length of the file.
        found: usize,
    },
    /// Written by another version.
    #[error("version {found}; this agent reads version {VERSION}")]
    Version {
        /// The version it says.
        found: u32,
    },
    /// Torn or flipped.
    #[error("checksum {found:016x}, the content has {expected:016x}")]
    Checksum {
        /// The checksum it says.
        found: u64,
        /// The checksum of what is there.
        expected: u64,
    },
    /// Whole, yet no state.
    #[error("content cannot be read: {0}")]
    Content(postcard::Error),
}

/// Writes states on a thread of its own; orders that wait are written together.
#[derive(Debug)]
pub(crate) struct Store {
    slot: Arc<Slot>,
    writer: Option<JoinHandle<()>>,
}

#[derive(Debug, Default)]
struct Slot {
    waiting: Mutex<Waiting>,
    changed: Condvar,
}

#[derive(Debug, Default)]
struct Waiting {
    /// The newest ticket, and the changes up to it.
    order: Option<(StoreTicket, Vec<StoredChange>)>,
    closed: bool,
}

impl Store {
    /// Starts the writer for the folder `dir`; outcomes go to `inputs`.
    pub(crate) fn start(
        dir: PathBuf,
        inputs: mpsc::Sender<Input>,
        events: Events,
    ) -> io::Result<Self> {
        let slot = Arc::new(Slot::default());
        let state = StoredState::default();
        let desk = Desk { slot: Arc::clone(&slot), dir, inputs, events, state, failing: false };
        let writer = thread::Builder::new().name("store".into()).spawn(move || desk.run())?;
        Ok(Self { slot, writer: Some(writer) })
    }

    /// Orders `change` to be written; its outcome answers all orders before it as well.
    pub(crate) fn put(&self, ticket: StoreTicket, change: StoredChange) {
        let mut waiting = self.slot.waiting.lock().unwrap_or_else(PoisonError::into_inner);
        let before = waiting.order.take().map(|(_, changes)| changes);
        let mut changes = before.filter(|_| !change.whole).unwrap_or_default();
        changes.push(change);
        waiting.order = Some((ticket, changes));
        self.slot.changed.notify_one();
    }
}

impl Drop for Store {
    /// Lets the last order reach the disk.
    fn drop(&mut self) {
        self.slot.waiting.lock().unwrap_or_else(PoisonError::into_inner).closed = true;
        self.slot.changed.notify_one();
        if let Some(writer) = self.writer.take() {
            // A panic of the writer was printed already; there is nothing left to save.
            let _ = writer.join();
        }
    }
}

/// The writer's side.
struct Desk {
    slot: Arc<Slot>,
    dir: PathBuf,
    inputs: mpsc::Sender<Input>,
    events: Events,
    state: StoredState,
    failing: bool,
}

impl Desk {
    fn run(mut self) {
        while let Some((ticket, changes)) = self.slot.take() {
            changes.into_iter().for_each(|change| self.state.take(change));
            let outcome = match write(&self.dir, &self.state) {
                Ok(()) => {
                    self.turn(false, "the state reaches the disk again");
                    Input::Stored { ticket }
                }
                Err(error) => {
                    let reason = format!("{}: {error}", self.dir.join(FILE_NAME).display());
                    self.turn(true, &reason);
                    Input::StoreFailed { ticket, reason }
                }
            };
            // The loop is gone when the agent stops; what is on disk stays good.
            if self.inputs.blocking_send(outcome).is_err() {
                return;
            }
        }
    }

    /// Says that the disk began to fail, or to work again; not each time.
    fn turn(&mut self, failing: bool, reason: &str) {
        if failing != self.failing {
            self.failing = failing;
            let kind = if failing { "store-failed" } else { "store-restored" };
            self.events.publish(self.events.new_event(kind, reason));
        }
    }
}

impl Slot {
    /// Waits for an order; `None` once closed and empty.
    fn take(&self) -> Option<(StoreTicket, Vec<StoredChange>)> {
        let mut waiting = self.waiting.lock().unwrap_or_else(PoisonError::into_inner);
        loop {
            if let Some(order) = waiting.order.take() {
                return Some(order);
            }
            if waiting.closed {
                return None;
            }
            waiting = self.changed.wait(waiting).unwrap_or_else(PoisonError::into_inner);
        }
    }
}

/// Reads the state in `dir`; bytes that are none are set aside, so that the next write does
/// not destroy what somebody may want to look at.
pub(crate) fn read(dir: &Path) -> io::Result<Remembered> {
    let path = dir.join(FILE_NAME);
    let bytes = match fs::read(&path) {
        Ok(bytes) => bytes,
        Err(error) if error.kind() == io::ErrorKind::NotFound => return Ok(Remembered::Nothing),
        Err(error) => return Err(error),
    };
    match decode(&bytes) {
        Ok(state) => Ok(Remembered::State(state)),
        Err(reason) => {
            let set_aside = free_name(dir);
            fs::rename(&path, &set_aside)?;
            Ok(Remembered::Corrupt { set_aside, reason })
        }
    }
}

fn free_name(dir: &Path) -> PathBuf {
    let mut number = 1_u64;
    loop {
        let path = dir.join(format!("state.corrupt-{number}"));
        if !path.exists() {
            return path;
        }
        number += 1;
    }
}

fn write(dir: &Path, state: &StoredState) -> io::Result<()> {
    let temporary = dir.join("state.new");
    let mut file = File::create(&temporary)?;
    file.write_all(&encode(state).map_err(io::Error::other)?)?;
    file.sync_all()?;
    fs::rename(&temporary, dir.join(FILE_NAME))?;
    File::open(dir)?.sync_all()
}

fn encode(state: &StoredState) -> Result<Vec<u8>, postcard::Error> {
    let content = postcard::to_allocvec(state)?;
    let mut bytes = Vec::with_capacity(HEADER_BYTES + content.len());
    bytes.extend_from_slice(MAGIC);
    bytes.extend_from_slice(&VERSION.to_le_bytes());
    bytes.extend_from_slice(&hash64(&content).to_le_bytes());
    bytes.extend_from_slice(&content);
    Ok(bytes)
}

fn decode(bytes: &[u8]) -> Result<StoredState, StateError> {
    let foreign = StateError::Foreign { found: bytes.len() };
    let Some(rest) = bytes.strip_prefix(MAGIC) else { return Err(foreign) };
    let Some((version, rest)) = rest.split_first_chunk::<4>() else { return Err(foreign) };
    let Some((checksum, content)) = rest.split_first_chunk::<8>() else { return Err(foreign) };
    let version = u32::from_le_bytes(*version);
    if version != VERSION {
        return Err(StateError::Version { found: version });
    }
    let (found, expected) = (u64::from_le_bytes(*checksum), hash64(content));
    if found != expected {
        return Err(StateError::Checksum { found, expected });
    }
    // an older build wrote fewer lists: those that were appended since are empty
    let padded = [content, &[0; LISTS_APPENDED]].concat();
    postcard::from_bytes(&padded).map_err(StateError::Content)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn events() -> Events {
        Events::new(sdr_core::id::RobotId::new("robot-1").unwrap())
    }

    fn state(incarnation: u64) -> StoredState {
        StoredState { incarnation, ..StoredState::default() }
    }

    /// What is new when the incarnation is: the first order holds everything.
    fn change(incarnation: u64) -> StoredChange {
        let address = std::net::SocketAddr::from(([10, 0, 0, 1], 7000));
        let (whole, peers) = (incarnation == 1, (incarnation == 1).then(|| vec![address]));
        StoredChange { whole, incarnation, peers, ..StoredChange::default() }
    }

    #[test]
    fn what_was_stored_last_is_read_back_and_its_ticket_answered() {
        let dir = tempfile::tempdir().unwrap();
        let (inputs, mut outcomes) = mpsc::channel(64);

        let store = Store::start(dir.path().into(), inputs, events()).unwrap();
        for ticket in 1..=20 {
            store.put(ticket, change(ticket));
        }
        drop(store);

        let mut last = 0;
        while let Ok(outcome) = outcomes.try_recv() {
            let Input::Stored { ticket } = outcome else { panic!("{outcome:?}") };
            assert!(ticket > last);
            last = ticket;
        }
        assert_eq!(last, 20);
        let Remembered::State(found) = read(dir.path()).unwrap() else { panic!("no state") };
        // what an order does not name stays
        assert_eq!((found.incarnation, found.peers.len()), (20, 1));
    }

    #[test]
    fn a_corrupt_state_is_set_aside_and_the_agent_starts_empty() {
        let dir = tempfile::tempdir().unwrap();
        for (number, spoil) in [(1, 25_usize), (2, 9), (3, 0)] {
            let mut bytes = encode(&StoredState { incarnation: 300, ..state(0) }).unwrap();
            let at = spoil.min(bytes.len() - 1);
            bytes[at] ^= 0x40;
            fs::write(dir.path().join(FILE_NAME), &bytes).unwrap();

            let Remembered::Corrupt { set_aside, .. } = read(dir.path()).unwrap() else {
                panic!("flip at {at} was not seen")
            };
            assert_eq!(set_aside, dir.path().join(format!("state.corrupt-{number}")));
            assert_eq!(fs::read(set_aside).unwrap(), bytes);
            assert!(matches!(read(dir.path()).unwrap(), Remembered::Nothing));
        }
    }

    #[test]
    fn every_truncation_is_seen() {
        let bytes = encode(&StoredState { incarnation: 1 << 40, ..state(0) }).unwrap();
        for length in 0..bytes.len() {
            assert!(decode(&bytes[..length]).is_err(), "{length} of {} bytes", bytes.len());
        }
    }

    #[test]
    fn a_disk_that_refuses_is_reported_with_the_ticket() {
        let dir = tempfile::tempdir().unwrap();
        let gone = dir.path().join("gone");
        let (inputs, mut outcomes) = mpsc::channel(8);

        let events = events();

        let store = Store::start(gone, inputs, events.clone()).unwrap();
        store.put(7, change(1));
        drop(store);

        let outcome = outcomes.try_recv().unwrap();
        let Input::StoreFailed { ticket: 7, reason } = outcome else { panic!("{outcome:?}") };
        assert!(reason.contains("gone/state"), "{reason}");
        assert_eq!(events.since(0)[0].event.kind, "store-failed");
    }
}
