//! The connection to the agent, on a thread of its own, so that a hung callback or a hung
//! agent never stops the other side.

use std::io::{self, ErrorKind, Read, Write};
use std::os::unix::net::UnixStream;
use std::sync::mpsc::{Receiver, SyncSender, TrySendError, sync_channel};
use std::thread::JoinHandle;
use std::time::{Duration, Instant};

use rustix::event::{PollFd, PollFlags, Timespec, poll};
use sdr_core::spec::ComponentProfile;

use super::{door::Door, identity::Identity, outbox::Outbox, wake::Wake};
use crate::protocol::{
    ErrorReport, FromComponent, Hello, LineBuffer, PROTOCOL_VERSION, RECONNECT_PERIOD, ToComponent,
    encode_line,
};

/// Most orders that wait for the execution thread.
const ORDERS_MAX: usize = 64;
/// Without ever having met an agent the process ends after this.
const FIRST_AGENT_WITHIN: Duration = Duration::from_secs(5);
/// How long the execution thread may take to end when nobody is there any more.
const ORPHAN_GRACE: Duration = Duration::from_secs(5);
/// How long the last words may take.
const FAREWELL_MAX: Duration = Duration::from_millis(500);
/// Bytes that may wait in this process for a slow agent; then words wait in the outbox.
const PENDING_MAX: usize = 256 * 1024;

/// What the link tells the execution thread.
#[derive(Debug)]
pub(super) enum News {
    /// An agent was greeted.
    Connected,
    /// It said something.
    Said(ToComponent),
    /// No agent for longer than it may act alone.
    Alone,
    /// No agent for too long.
    Orphaned,
    /// The component itself wishes to end.
    Stop,
}

/// The execution thread's end.
#[derive(Debug)]
pub(super) struct Link {
    pub(super) outbox: Outbox,
    news: Receiver<News>,
    /// Rung when there is news.
    pub(super) wake: Wake,
    thread: JoinHandle<()>,
    must_stop: bool,
}

impl Link {
    pub(super) fn start(identity: Identity, profile: ComponentProfile) -> io::Result<Self> {
        let wake = Wake::new()?;
        let outbox_wake = Wake::new()?;
        let outbox = Outbox::new(outbox_wake.clone());
        let (sender, news) = sync_channel(ORDERS_MAX);
        let worker = Worker {
            identity,
            profile,
            outbox: outbox.clone(),
            outbox_wake,
            news: sender,
            wake: wake.clone(),
        };
        let thread =
            std::thread::Builder::new().name("agent-link".into()).spawn(move || worker.run())?;
        Ok(Self { outbox, news, wake, thread, must_stop: false })
    }

    /// The next thing to do, if there is any.
    pub(super) fn next_news(&mut self) -> Option<News> {
        if std::mem::take(&mut self.must_stop) {
            return Some(News::Stop);
        }
        self.news.try_recv().ok()
    }

    /// The component wishes to end, as soon as its callback returned.
    pub(super) fn stop(&mut self) {
        self.must_stop = true;
        self.wake.ring();
    }

    /// Sends what waits and ends the thread, within half a second.
    pub(super) fn close(self) {
        self.outbox.close();
        // It panics only by a bug, which the process's end reports as well as anything.
        let _ = self.thread.join();
    }
}

/// The link thread.
struct Worker {
    identity: Identity,
    profile: ComponentProfile,
    outbox: Outbox,
    outbox_wake: Wake,
    news: SyncSender<News>,
    wake: Wake,
}

/// Why a connection ended.
enum End {
    /// The agent went away, or was sent away.
    Lost,
    /// Everything was said.
    Closed,
}

impl Worker {
    fn run(self) {
        let door = Door::watch(&self.identity.socket);
        let mut alone_since = Instant::now();
        let mut met = false;
        let mut lease = None;
        loop {
            if let Ok(stream) = UnixStream::connect(&self.identity.socket) {
                met = true;
                let end = self.serve(&stream);
                self.outbox.disconnect();
                if matches!(end, Ok(End::Closed)) {
                    return;
                }
                alone_since = Instant::now();
                lease = self.identity.lease;
            }
            let limit = if met { self.identity.orphan } else { Some(FIRST_AGENT_WITHIN) };
            if limit.is_some_and(|limit| alone_since.elapsed() >= limit) {
                return self.give_up(met);
            }
            let alone = alone_since.elapsed();
            if lease.take_if(|lease| alone >= *lease).is_some() {
                let _ = self.news.try_send(News::Alone);
                self.wake.ring();
            }
            let ends = limit.into_iter().chain(lease).map(|end| end.saturating_sub(alone));
            let wait = ends.chain([RECONNECT_PERIOD]).min().unwrap_or(RECONNECT_PERIOD);
            if self.pause(wait, door.as_ref()) {
                return;
            }
        }
    }

    /// Waits, until an agent opens its door at the latest; true when the execution thread ended
    /// meanwhile.
    fn pause(&self, wait: Duration, door: Option<&Door>) -> bool {
        self.outbox_wake.clear();
        let limit = Timespec::try_from(wait).ok();
        let mut fds = vec![PollFd::new(&self.outbox_wake, PollFlags::IN)];
        fds.extend(door.map(|door| PollFd::new(door, PollFlags::IN)));
        let _ = poll(&mut fds, limit.as_ref());
        door.into_iter().for_each(Door::clear);
        self.outbox.is_closed()
    }

    /// Tells the execution thread to end, and ends the process when it cannot.
    fn give_up(&self, met: bool) {
        let why = if met { "the agent went away" } else { "no agent answers" };
        crate::log(format_args!("{}: {why}; ending", self.identity.component));
        let start = Instant::now();
        let _ = self.news.try_send(News::Orphaned);
        self.wake.ring();
        while !self.pause(Duration::from_millis(100), None) {
            if start.elapsed() > ORPHAN_GRACE {
                std::process::exit(1);
            }
        }
    }

    fn serve(&self, stream: &UnixStream) -> io::Result<End> {
        stream.set_nonblocking(true)?;
        let mut pending = encode(&FromComponent::Hello(Box::new(Hello {
            v: PROTOCOL_VERSION,
            component: self.identity.component.clone(),
            instance: self.identity.instance,
            pid: std::process::id(),
            badge: self.identity.badge.clone(),
            profile: self.profile.clone(),
            now: self.outbox.connect(),
        })))?;
        let mut lines = LineBuffer::of_agent();
        let mut closing: Option<Instant> = None;
        self.tell(News::Connected)?;
        loop {
            self.fill(&mut pending)?;
            write_some(stream, &mut pending)?;
            if self.outbox.is_closed() {
                let since = closing.get_or_insert_with(Instant::now);
                if pending.is_empty() || since.elapsed() > FAREWELL_MAX {
                    return Ok(End::Closed);
                }
            }
            self.wait(stream, !pending.is_empty(), closing.is_some())?;
            if let Err(reason) = self.read(stream, &mut lines)? {
                crate::log(format_args!("{}: {reason}", self.identity.component));
                pending.extend(encode(&FromComponent::Error(ErrorReport { message: reason }))?);
                write_some(stream, &mut pending)?;
                return Ok(End::Lost);
            }
        }
    }

    fn fill(&self, pending: &mut Vec<u8>) -> io::Result<()> {
        while pending.len() < PENDING_MAX {
            let Some(word) = self.outbox.take() else { return Ok(()) };
            pending.extend(encode(&word)?);
        }
        Ok(())
    }

    fn wait(&self, stream: &UnixStream, must_write: bool, is_closing: bool) -> io::Result<()> {
        let wanted = if must_write { PollFlags::IN | PollFlags::OUT } else { PollFlags::IN };
        let mut fds = [PollFd::new(stream, wanted), PollFd::new(&self.outbox_wake, PollFlags::IN)];
        let limit = Timespec { tv_sec: 0, tv_nsec: 50_000_000 };
        match poll(&mut fds, is_closing.then_some(&limit)) {
            Ok(_) => {}
            Err(error) if error == rustix::io::Errno::INTR => {}
            Err(error) => return Err(error.into()),
        }
        self.outbox_wake.clear();
        Ok(())
    }

    /// Reads what is there; the inner error is what to answer before hanging up.
    fn read(
        &self,
        mut stream: &UnixStream,
        lines: &mut LineBuffer,
    ) -> io::Result<Result<(), String>> {
        let mut chunk = [0; 16 * 1024];
        loop {
            match stream.read(&mut chunk) {
                Ok(0) => return Err(ErrorKind::UnexpectedEof.into()),
                Ok(count) => lines.push(&chunk[..count]),
                Err(error) if error.kind() == ErrorKind::WouldBlock => return Ok(Ok(())),
                Err(error) if error.kind() == ErrorKind::Interrupted => continue,
                Err(error) => return Err(error),
            }
            loop {
                match lines.next_message() {
                    Ok(Some(message)) => self.tell(News::Said(message))?,
                    Ok(None) => break,
                    Err(error) => return Ok(Err(format!("the agent's {error}"))),
                }
            }
        }
    }

    /// A full queue means that the agent floods a thread that does not listen: start over.
    fn tell(&self, news: News) -> io::Result<()> {
        match self.news.try_send(news) {
            Ok(()) => {
                self.wake.ring();
                Ok(())
            }
            Err(TrySendError::Full(_)) => Err(io::Error::other("too many orders wait")),
            Err(TrySendError::Disconnected(_)) => Ok(()),
        }
    }
}

fn encode(word: &FromComponent) -> io::Result<Vec<u8>> {
    encode_line(word).map_err(io::Error::other)
}

fn write_some(mut stream: &UnixStream, pending: &mut Vec<u8>) -> io::Result<()> {
    while !pending.is_empty() {
        match stream.write(pending) {
            Ok(0) => return Err(ErrorKind::WriteZero.into()),
            Ok(count) => drop(pending.drain(..count)),
            Err(error) if error.kind() == ErrorKind::WouldBlock => return Ok(()),
            Err(error) if error.kind() == ErrorKind::Interrupted => {}
            Err(error) => return Err(error),
        }
    }
    Ok(())
}
