//! One client of a device, seen from the device: nothing here waits.

use std::io::{ErrorKind, Read, Write};
use std::os::unix::net::{UnixListener, UnixStream};

use rustix::event::{PollFd, PollFlags};

use crate::device::{CLIENTS_MAX, ERRORS_MAX, Greeting, LineBuffer, line_of};

/// Most bytes that wait for a slow reader before whole messages are left out.
const OUTPUT_BYTES_MAX: usize = 1 << 20;

/// A connected client.
#[derive(Debug)]
pub(super) struct Peer {
    stream: UnixStream,
    input: LineBuffer,
    output: Vec<u8>,
    lines: u64,
    errors: u32,
    state: State,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum State {
    Open,
    /// What is written still goes out, nothing more is read.
    Closing,
    Gone,
}

impl Peer {
    fn new(stream: UnixStream, greeting: &Greeting) -> Option<Self> {
        stream.set_nonblocking(true).ok()?;
        let mut peer = Self {
            stream,
            input: LineBuffer::default(),
            output: Vec::new(),
            lines: 0,
            errors: 0,
            state: State::Open,
        };
        peer.send(&line_of(greeting));
        Some(peer)
    }

    /// Reads what has come; whole lines with their numbers.
    pub(super) fn receive(&mut self) -> Vec<(u64, Vec<u8>)> {
        let mut chunk = [0; 4096];
        if self.state != State::Open {
            return Vec::new();
        }
        match self.stream.read(&mut chunk) {
            Ok(0) => self.state = State::Gone,
            Ok(count) => self.input.push(&chunk[..count]),
            Err(error) if error.kind() == ErrorKind::WouldBlock => {}
            Err(_) => self.state = State::Gone,
        }
        let mut lines = Vec::new();
        loop {
            match self.input.next_line() {
                Ok(Some(line)) => {
                    self.lines += 1;
                    lines.push((self.lines, line));
                }
                Ok(None) => return lines,
                Err(_) => {
                    self.lines += 1;
                    let reason = format!("line {}: longer than 512 bytes; hanging up", self.lines);
                    self.refuse(&reason);
                    self.hang_up();
                    return lines;
                }
            }
        }
    }

    /// Answers an error and hangs up after too many.
    pub(super) fn refuse(&mut self, reason: &str) {
        self.errors += 1;
        let mut line = serde_json::json!({ "error": reason }).to_string();
        line.push('\n');
        self.send(line.as_bytes());
        if self.errors >= ERRORS_MAX {
            self.hang_up();
        }
    }

    /// Reads no more and ends when all is written.
    fn hang_up(&mut self) {
        if self.state == State::Open {
            self.state = State::Closing;
            self.flush();
        }
    }

    /// Sends a whole message, later if need be; a reader too slow loses it whole.
    pub(super) fn send(&mut self, message: &[u8]) {
        if self.state == State::Open && self.output.len() + message.len() <= OUTPUT_BYTES_MAX {
            self.output.extend_from_slice(message);
        }
        self.flush();
    }

    /// Writes what waits, as far as the reader takes it.
    pub(super) fn flush(&mut self) {
        while !self.output.is_empty() {
            match self.stream.write(&self.output) {
                Ok(count) => drop(self.output.drain(..count)),
                Err(error) if error.kind() == ErrorKind::WouldBlock => return,
                Err(_) => {
                    self.state = State::Gone;
                    return;
                }
            }
        }
        if self.state == State::Closing {
            self.state = State::Gone;
        }
    }

    /// Bytes that wait for the reader.
    pub(super) fn waiting(&self) -> usize {
        self.output.len()
    }

    pub(super) fn is_gone(&self) -> bool {
        self.state == State::Gone
    }

    /// What to poll for.
    pub(super) fn poll_fd(&self) -> PollFd<'_> {
        let read = if self.state == State::Open { PollFlags::IN } else { PollFlags::empty() };
        let write = if self.output.is_empty() { PollFlags::empty() } else { PollFlags::OUT };
        PollFd::new(&self.stream, read | write)
    }

    /// Ends a client that only hung up: poll reports that even when nothing is asked for.
    pub(super) fn note(&mut self, events: PollFlags) {
        if events.intersects(PollFlags::HUP | PollFlags::ERR) && !events.contains(PollFlags::IN) {
            self.state = State::Gone;
        }
    }
}

/// A device's socket and its clients.
#[derive(Debug)]
pub(super) struct Device {
    pub(super) listener: UnixListener,
    pub(super) greeting: Greeting,
    pub(super) peers: Vec<Peer>,
}

impl Device {
    /// Takes all who wait at the socket; greets them, or says that it is full.
    pub(super) fn accept(&mut self) {
        while let Ok((stream, _)) = self.listener.accept() {
            if let Some(mut peer) = Peer::new(stream, &self.greeting) {
                if self.peers.len() < CLIENTS_MAX {
                    self.peers.push(peer);
                } else {
                    peer.refuse("16 clients already, hanging up");
                }
            }
        }
    }

    /// What to poll for: the socket, then each client.
    pub(super) fn poll_fds(&self) -> impl Iterator<Item = PollFd<'_>> {
        let listener = PollFd::new(&self.listener, PollFlags::IN);
        std::iter::once(listener).chain(self.peers.iter().map(Peer::poll_fd))
    }
}

/// Waits for any device, a wake-up, or the end of `timeout_ns`; `true` when woken to stop.
pub(super) fn wait_for(devices: &mut [Device], wake: &UnixStream, timeout_ns: u64) -> bool {
    let mut fds = vec![PollFd::new(wake, PollFlags::IN)];
    fds.extend(devices.iter().flat_map(Device::poll_fds));
    let limit = rustix::event::Timespec::try_from(std::time::Duration::from_nanos(timeout_ns)).ok();
    // An interrupted poll is a short one.
    let _ = rustix::event::poll(&mut fds, limit.as_ref());
    let events: Vec<PollFlags> = fds.iter().map(PollFd::revents).collect();
    drop(fds);
    let mut events = events.into_iter();
    let woken = events.next().is_some_and(|event| !event.is_empty());
    for device in devices {
        let arrivals = events.next().is_some_and(|event| !event.is_empty());
        for (peer, event) in device.peers.iter_mut().zip(&mut events) {
            peer.note(event);
            peer.flush();
        }
        if arrivals {
            device.accept();
        }
    }
    woken
}
