//! What the brain must not forget, on disk: replaced as a whole, checked when read. The brain
//! orders what changed; the writer holds the whole, whose facts are the brain's own. The bytes
//! are those of [`sdr_core::disk`].

use std::fs::{self, File};
use std::io::{self, Write as _};
use std::path::{Path, PathBuf};
use std::sync::{Arc, Condvar, Mutex, PoisonError};
use std::thread::{self, JoinHandle};

use sdr_core::{
    disk::{self, StateError},
    effect::{StoredChange, StoredState},
    input::{Input, StoreTicket},
};
use tokio::sync::mpsc;

use crate::blobs::BlobStore;
use crate::events::Events;

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
        parts: BlobStore,
        inputs: mpsc::Sender<Input>,
        events: Events,
    ) -> io::Result<Self> {
        let slot = Arc::new(Slot::default());
        let state = StoredState::default();
        let own = Arc::clone(&slot);
        let desk = Desk { slot: own, dir, parts, inputs, events, state, failing: false };
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
    parts: BlobStore,
    inputs: mpsc::Sender<Input>,
    events: Events,
    state: StoredState,
    failing: bool,
}

impl Desk {
    fn run(mut self) {
        while let Some((ticket, changes)) = self.slot.take() {
            let outcome = match self.write(changes) {
                Ok(()) => {
                    self.turn(false, "the state reaches the disk again");
                    Input::Stored { ticket }
                }
                Err(reason) => {
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

    /// What the state names is there before it, and goes after it.
    fn write(&mut self, changes: Vec<StoredChange>) -> Result<(), String> {
        let mut kept = Ok(());
        for mut change in changes {
            let blobs = std::mem::take(&mut change.blobs);
            // the brain tells all anew after a failure; nothing of this order is on disk then
            kept = kept.and_then(|()| self.parts.keep_parts(&blobs));
            self.state.take(change);
        }
        kept.map_err(|error| error.to_string())?;
        let file = self.dir.join(FILE_NAME);
        write(&self.dir, &self.state).map_err(|error| format!("{}: {error}", file.display()))?;
        if let Err(error) = self.parts.sweep_parts(&self.state.blobs().collect()) {
            tracing::warn!(event = "parts-unswept", %error, next = "with the next state");
        }
        Ok(())
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
    match disk::decode(&bytes) {
        Ok(state) => Ok(Remembered::State(state)),
        Err(reason) => Ok(Remembered::Corrupt { set_aside: set_aside(&path)?, reason }),
    }
}

/// Gives a file that cannot be read another name, which nobody uses; the name.
pub(crate) fn set_aside(path: &Path) -> io::Result<PathBuf> {
    let name = |number: u64| {
        let mut name = path.as_os_str().to_owned();
        name.push(format!(".corrupt-{number}"));
        PathBuf::from(name)
    };
    let free = (1..).map(name).find(|name| !name.exists()).expect("numbers do not end");
    fs::rename(path, &free)?;
    Ok(free)
}

fn write(dir: &Path, state: &StoredState) -> io::Result<()> {
    let temporary = dir.join("state.new");
    let mut file = File::create(&temporary)?;
    file.write_all(&disk::encode(state))?;
    file.sync_all()?;
    fs::rename(&temporary, dir.join(FILE_NAME))?;
    File::open(dir)?.sync_all()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn parts(dir: &Path) -> BlobStore {
        BlobStore::open(dir, 1 << 20).unwrap()
    }

    fn events() -> Events {
        Events::new(sdr_core::id::RobotId::new("robot-1").unwrap())
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

        let store = Store::start(dir.path().into(), parts(dir.path()), inputs, events()).unwrap();
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
            let mut bytes =
                disk::encode(&StoredState { incarnation: 300, ..StoredState::default() });
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
    fn a_disk_that_refuses_is_reported_with_the_ticket() {
        let dir = tempfile::tempdir().unwrap();
        let gone = dir.path().join("gone");
        let (inputs, mut outcomes) = mpsc::channel(8);

        let events = events();

        let store = Store::start(gone, parts(dir.path()), inputs, events.clone()).unwrap();
        store.put(7, change(1));
        drop(store);

        let outcome = outcomes.try_recv().unwrap();
        let Input::StoreFailed { ticket: 7, reason } = outcome else { panic!("{outcome:?}") };
        assert!(reason.contains("gone/state"), "{reason}");
        assert_eq!(events.since(0)[0].event.kind, "store-failed");
    }
}
