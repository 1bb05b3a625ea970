//! The thread that carries frames from TAP to TAP as the radio lets them.

use std::{
    cmp::Reverse,
    collections::BinaryHeap,
    io,
    os::{
        fd::{AsFd as _, OwnedFd},
        unix::net::UnixStream,
    },
    sync::{Arc, Mutex, MutexGuard, PoisonError},
    thread::{Builder, JoinHandle},
    time::Duration,
};

use rustix::{
    event::{PollFd, PollFlags, Timespec, poll},
    io::{Errno, read, write},
};

use super::{
    air::Air,
    frame::{FRAME_BYTES_MAX, receiver},
};

/// Frames on their way; more are dropped.
const FLYING_MAX: usize = 50_000;
/// Frames read from one TAP before the others have their turn.
const TURN: usize = 32;

/// The radio, shared by the relay and whoever changes it.
#[derive(Clone, Debug)]
pub struct SharedAir(Arc<Mutex<Air>>);

impl SharedAir {
    pub(super) fn new(air: Air) -> Self {
        Self(Arc::new(Mutex::new(air)))
    }

    /// The radio; the relay waits meanwhile.
    pub fn lock(&self) -> MutexGuard<'_, Air> {
        self.0.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

/// The running relay. Dropping it ends it.
#[derive(Debug)]
pub(super) struct Relay {
    wake: Option<UnixStream>,
    thread: Option<JoinHandle<()>>,
}

/// One frame on its way.
#[derive(Debug, PartialEq, Eq, PartialOrd, Ord)]
struct Flying {
    at: Duration,
    /// Keeps frames of one moment in order.
    number: u64,
    to: usize,
    frame: Arc<[u8]>,
}

impl Relay {
    /// Carries frames between `taps`, in the order of the robots; `since` is the zero of its time.
    pub(super) fn start(taps: Vec<OwnedFd>, air: SharedAir, since: Duration) -> io::Result<Self> {
        let (wake, theirs) = UnixStream::pair()?;
        let flying = BinaryHeap::new();
        let mut desk = Desk { taps, air, since, flying, number: 0 };
        let thread = Builder::new().name("relay".to_owned()).spawn(move || desk.run(&theirs))?;
        Ok(Self { wake: Some(wake), thread: Some(thread) })
    }
}

impl Drop for Relay {
    fn drop(&mut self) {
        drop(self.wake.take());
        if let Some(thread) = self.thread.take() {
            // A thread that panicked has already said so.
            let _ = thread.join();
        }
    }
}

struct Desk {
    taps: Vec<OwnedFd>,
    air: SharedAir,
    since: Duration,
    flying: BinaryHeap<Reverse<Flying>>,
    number: u64,
}

impl Desk {
    fn run(&mut self, wake: &UnixStream) {
        loop {
            let now = self.now();
            self.land(now);
            let wait = self.flying.peek().map(|next| next.0.at.saturating_sub(now));
            let Some(ready) = self.wait(wake, wait) else { return };
            for robot in ready {
                self.take_from(robot);
            }
        }
    }

    fn now(&self) -> Duration {
        super::monotonic().saturating_sub(self.since)
    }

    /// Robots that have sent something; `None` when it is over.
    fn wait(&self, wake: &UnixStream, limit: Option<Duration>) -> Option<Vec<usize>> {
        let mut fds = vec![PollFd::new(wake, PollFlags::IN)];
        fds.extend(self.taps.iter().map(|tap| PollFd::new(tap, PollFlags::IN)));
        let limit = limit.and_then(|limit| Timespec::try_from(limit).ok());
        match poll(&mut fds, limit.as_ref()) {
            Ok(_) | Err(Errno::INTR) => {}
            Err(_) => return None,
        }
        if !fds[0].revents().is_empty() {
            return None;
        }
        let ready = fds[1..].iter().enumerate().filter(|(_, fd)| !fd.revents().is_empty());
        Some(ready.map(|(robot, _)| robot).collect())
    }

    fn take_from(&mut self, robot: usize) {
        let mut buffer = [0; FRAME_BYTES_MAX + 64];
        for _ in 0..TURN {
            let Ok(length) = read(self.taps[robot].as_fd(), &mut buffer) else { return };
            let frame = &buffer[..length];
            let Some(to) = receiver(frame) else { continue };
            let now = self.now();
            let arrivals = self.air.lock().send(now, robot, to, length);
            let frame: Arc<[u8]> = frame.into();
            for (to, at) in arrivals {
                if self.flying.len() < FLYING_MAX {
                    self.number += 1;
                    let flying = Flying { at, number: self.number, to, frame: Arc::clone(&frame) };
                    self.flying.push(Reverse(flying));
                }
            }
        }
    }

    fn land(&mut self, now: Duration) {
        while self.flying.peek().is_some_and(|next| next.0.at <= now) {
            let Some(Reverse(flying)) = self.flying.pop() else { return };
            // A receiver whose queue is full has missed it, as with any radio.
            let _ = write(self.taps[flying.to].as_fd(), &flying.frame);
        }
    }
}
