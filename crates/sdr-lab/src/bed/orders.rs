//! What the bed and a robot's first process say to each other: one JSON object a line.

use std::{
    io::{self, BufRead as _, BufReader, Write as _},
    os::unix::net::UnixStream,
    path::PathBuf,
    time::Duration,
};

use serde::{Deserialize, Serialize};

/// Longest line, bytes.
const LINE_BYTES_MAX: u64 = 64 << 10;

/// What a robot's first process is to do.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub(super) enum Order {
    /// Start a program; its output goes to the end of `log`.
    Start {
        program: PathBuf,
        arguments: Vec<String>,
        environment: Vec<(String, String)>,
        log: PathBuf,
    },
    /// Send a signal to processes.
    Signal { whom: Whom, signal: i32 },
    /// Fill the disk at this folder until nothing goes in any more, or make room again.
    Fill { folder: PathBuf, full: bool },
    /// Let every write that waits for the disk take so long.
    Slow { delay: Duration },
}

/// Processes of one robot.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub enum Whom {
    /// The agent.
    Agent,
    /// All processes of a component: `system/component`, or the component alone.
    Component(String),
}

/// What a robot's first process says.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub(super) enum Answer {
    /// The order was carried out; so many processes were concerned.
    Done { count: usize },
    /// It could not be.
    Failed { reason: String },
    /// The agent ended; no answer to an order.
    AgentEnded { status: String },
}

/// One end of the line.
#[derive(Debug)]
pub(super) struct Line {
    reader: BufReader<UnixStream>,
    writer: UnixStream,
}

impl Line {
    pub(super) fn new(stream: UnixStream) -> io::Result<Self> {
        Ok(Self { reader: BufReader::new(stream.try_clone()?), writer: stream })
    }

    pub(super) fn say(&mut self, what: &impl Serialize) -> io::Result<()> {
        let mut text = serde_json::to_vec(what)?;
        text.push(b'\n');
        self.writer.write_all(&text)
    }

    /// The next line; `None` when the other end is gone.
    pub(super) fn hear<T: for<'de> Deserialize<'de>>(&mut self) -> io::Result<Option<T>> {
        let mut line = Vec::new();
        let mut bounded = io::Read::take(&mut self.reader, LINE_BYTES_MAX);
        match bounded.read_until(b'\n', &mut line)? {
            0 => Ok(None),
            _ => Ok(Some(serde_json::from_slice(&line)?)),
        }
    }

    /// How long [`Line::hear`] waits.
    pub(super) fn wait_at_most(&self, limit: Option<Duration>) -> io::Result<()> {
        self.reader.get_ref().set_read_timeout(limit)
    }

    /// Whether a line may be here already.
    pub(super) fn has_more(&self) -> bool {
        use rustix::event::{PollFd, PollFlags, Timespec, poll};
        let mut fds = [PollFd::new(self.reader.get_ref(), PollFlags::IN)];
        let now = Timespec { tv_sec: 0, tv_nsec: 0 };
        !self.reader.buffer().is_empty() || poll(&mut fds, Some(&now)).is_ok_and(|ready| ready > 0)
    }

    /// A second writing end.
    pub(super) fn mouth(&self) -> io::Result<UnixStream> {
        self.writer.try_clone()
    }
}
