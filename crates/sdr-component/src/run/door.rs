//! Notices at once when an agent opens its socket, so that a new one is greeted within a
//! millisecond.

use std::mem::MaybeUninit;
use std::os::fd::{AsFd, BorrowedFd, OwnedFd};
use std::path::Path;

use rustix::fs::inotify::{CreateFlags, Reader, WatchFlags, add_watch, init};

/// Watches the folder of a socket.
#[derive(Debug)]
pub(super) struct Door(OwnedFd);

impl Door {
    /// `None` where the kernel refuses: then only the clock says when to knock.
    pub(super) fn watch(socket: &Path) -> Option<Self> {
        let flags = CreateFlags::CLOEXEC | CreateFlags::NONBLOCK;
        let watch = init(flags).ok()?;
        add_watch(&watch, socket.parent()?, WatchFlags::CREATE | WatchFlags::MOVED_TO).ok()?;
        Some(Self(watch))
    }

    /// Forgets what was noticed so far.
    pub(super) fn clear(&self) {
        let mut buffer = [MaybeUninit::<u8>::uninit(); 1024];
        let mut events = Reader::new(&self.0, &mut buffer);
        while events.next().is_ok() {}
    }
}

impl AsFd for Door {
    fn as_fd(&self) -> BorrowedFd<'_> {
        self.0.as_fd()
    }
}

#[cfg(test)]
mod tests {
    use rustix::event::{PollFd, PollFlags, Timespec, poll};

    use super::*;

    fn is_noticed(door: &Door, within_ns: i64) -> bool {
        let limit = Timespec { tv_sec: 0, tv_nsec: within_ns };
        poll(&mut [PollFd::new(door, PollFlags::IN)], Some(&limit)).unwrap() == 1
    }

    #[test]
    fn a_socket_that_is_put_in_place_is_noticed() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("c.sock");
        let door = Door::watch(&path).unwrap();
        std::fs::write(folder.path().join("c.new"), "").unwrap();
        door.clear();
        assert!(!is_noticed(&door, 0));

        std::fs::rename(folder.path().join("c.new"), &path).unwrap();

        assert!(is_noticed(&door, 900_000_000));
        door.clear();
        assert!(!is_noticed(&door, 0));
    }
}
