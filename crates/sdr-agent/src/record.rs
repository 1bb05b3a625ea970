//! The robot's recording: MCAP with ROS 2 schemas and CDR bodies.
//!
//! Whoever has something to say holds a [`RecordSender`]; one thread writes. The thread
//! never makes its senders wait: what does not fit the queue is dropped and counted.

mod tape;

use std::path::{Path, PathBuf};
use std::sync::{
    Arc,
    atomic::{AtomicU64, AtomicUsize, Ordering},
    mpsc::{self, Receiver, SyncSender, TrySendError},
};
use std::thread::{self, JoinHandle};
use std::time::Duration;
use std::{fs, io};

use sdr_core::{
    event::Event,
    id::RobotId,
    recording::{Recorded, Stamp},
};
use serde::Serialize;

use crate::clock;
use crate::events::Events;
use tape::Tape;

/// Most messages that wait for the writer.
const QUEUE_MESSAGES_MAX: usize = 8192;
/// Most bytes that wait for the writer.
const QUEUE_BYTES_MAX: usize = 16 << 20;
/// Time between two flushes while the recording is young; it grows with its age, since each
/// flush makes an index entry that is kept until the end.
const FLUSH_PERIOD: Duration = Duration::from_secs(1);
/// Time between two flushes at most.
const FLUSH_PERIOD_MAX: Duration = Duration::from_secs(10);

/// What the recorder says of itself.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) enum RecorderNews {
    /// So many messages did not fit the queue since the last time.
    Dropped(u64),
    /// The file reached its bound; nothing is recorded any more.
    Full {
        /// Bytes written.
        bytes: u64,
    },
    /// The disk refused; nothing is recorded any more.
    Failed(String),
}

/// One message on its way to the file.
#[derive(Debug)]
struct Line {
    topic: Arc<str>,
    type_name: Arc<str>,
    definition: Arc<str>,
    monotonic_ns: u64,
    cdr: Vec<u8>,
}

#[derive(Debug)]
enum Order {
    Write(Line),
    Flush(SyncSender<()>),
    Finish,
}

/// Hands messages to the recording; cheap to clone, never waits.
#[derive(Clone, Debug)]
pub(crate) struct RecordSender {
    queue: SyncSender<Order>,
    topics: Arc<str>,
    robot: Arc<str>,
    pressure: Arc<Pressure>,
}

#[derive(Debug, Default)]
struct Pressure {
    waiting_bytes: AtomicUsize,
    dropped: AtomicU64,
}

/// Wall time of now, as messages carry it.
pub(crate) fn stamp() -> Stamp {
    let wall = clock::wall();
    Stamp { sec: i32::try_from(wall.as_secs()).unwrap_or(i32::MAX), nanosec: wall.subsec_nanos() }
}

impl RecorderNews {
    /// As operators hear it.
    #[expect(clippy::cast_precision_loss, reason = "counts stay far below 2^53")]
    pub(crate) fn event(self, events: &Events) -> Event {
        match self {
            Self::Dropped(count) => events
                .new_event("recorder-dropped", format!("{count} messages did not fit the queue"))
                .number("messages", count as f64),
            Self::Full { bytes } => events
                .new_event("recorder-full", "the recording reached its bound and ends")
                .number("bytes", bytes as f64),
            Self::Failed(reason) => events.new_event("recorder-failed", reason),
        }
    }
}

/// Removes the oldest recordings of `robot` in `dir` until the rest takes `bytes_max` at most.
pub(crate) fn forget_oldest(dir: &Path, robot: &RobotId, bytes_max: u64) {
    // A folder that is not there yet holds nothing.
    let Ok(entries) = fs::read_dir(dir) else { return };
    let begin = format!("{robot}-");
    let ours = |name: &str| {
        let time = name.strip_prefix(&begin).and_then(|rest| rest.strip_suffix(".mcap"));
        time.is_some_and(|time| time.bytes().all(|byte| byte.is_ascii_digit()))
    };
    let mut files: Vec<(PathBuf, u64)> = entries
        .flatten()
        .filter(|entry| entry.file_name().to_str().is_some_and(ours))
        .filter_map(|entry| Some((entry.path(), entry.metadata().ok()?.len())))
        .collect();
    files.sort();
    let mut sum: u64 = files.iter().map(|(_, bytes)| bytes).sum();
    for (path, bytes) in files {
        if sum <= bytes_max {
            return;
        }
        match fs::remove_file(&path) {
            Ok(()) => sum -= bytes,
            Err(error) => {
                tracing::warn!(event = "recording-kept", path = %path.display(), %error);
            }
        }
    }
}

impl RecordSender {
    /// For a robot that records nothing.
    pub(crate) fn nowhere(robot: &RobotId) -> Self {
        let (queue, _) = mpsc::sync_channel(1);
        let (topics, robot) = (Arc::from(""), robot.as_str().into());
        Self { queue, topics, robot, pressure: Arc::default() }
    }

    /// The robot that records.
    pub(crate) fn robot(&self) -> &str {
        &self.robot
    }

    /// Records one of the agent's own messages, made at `monotonic_ns`.
    pub(crate) fn record<T: Recorded + Serialize>(&self, monotonic_ns: u64, message: &T) {
        let mut cdr = vec![0, 1, 0, 0];
        let body = cdr_encoding::to_vec::<T, byteorder::LittleEndian>(message)
            .expect("recorded messages hold only what CDR can say");
        cdr.extend_from_slice(&body);
        let topic = format!("{}/{}", self.topics, T::TOPIC);
        self.message(&topic, T::TYPE, T::DEFINITION, monotonic_ns, cdr);
    }

    /// Records a message of any ROS 2 type: `cdr_bytes` begin with the encapsulation header.
    pub(crate) fn message(
        &self,
        topic: &str,
        type_name: &str,
        definition: &str,
        monotonic_ns: u64,
        cdr_bytes: Vec<u8>,
    ) {
        let bytes = cdr_bytes.len();
        let before = self.pressure.waiting_bytes.fetch_add(bytes, Ordering::Relaxed);
        let line = Line {
            topic: topic.into(),
            type_name: type_name.into(),
            definition: definition.into(),
            monotonic_ns,
            cdr: cdr_bytes,
        };
        let fits = before + bytes <= QUEUE_BYTES_MAX;
        let sent = fits && {
            match self.queue.try_send(Order::Write(line)) {
                Ok(()) => true,
                // Disconnected: the recording is finished or failed, which was said already.
                Err(TrySendError::Full(_) | TrySendError::Disconnected(_)) => false,
            }
        };
        if !sent {
            self.pressure.waiting_bytes.fetch_sub(bytes, Ordering::Relaxed);
            self.pressure.dropped.fetch_add(1, Ordering::Relaxed);
        }
    }
}

/// The recording and its thread.
#[derive(Debug)]
pub(crate) struct Recorder {
    sender: RecordSender,
    path: PathBuf,
    writer: Option<JoinHandle<()>>,
}

impl Recorder {
    /// Opens `<dir>/<robot>-<wall time>.mcap` and starts its writer; `news` is called on the
    /// writer's thread.
    pub(crate) fn start(
        dir: &Path,
        robot: &RobotId,
        bytes_max: u64,
        news: impl Fn(RecorderNews) + Send + 'static,
    ) -> io::Result<Self> {
        fs::create_dir_all(dir)?;
        let path = dir.join(format!("{robot}-{}.mcap", clock::wall().as_millis()));
        let tape = Tape::create(&path).map_err(io::Error::other)?;
        let (queue, orders) = mpsc::sync_channel(QUEUE_MESSAGES_MAX);
        let pressure = Arc::new(Pressure::default());
        let desk = Desk { orders, pressure: Arc::clone(&pressure), tape, bytes_max };
        let writer = thread::Builder::new().name("record".into()).spawn(move || desk.run(&news))?;
        let topics = format!("/sdr/{}", robot.topic_word()).into();
        let sender = RecordSender { queue, topics, robot: robot.as_str().into(), pressure };
        Ok(Self { sender, path, writer: Some(writer) })
    }

    /// A way in.
    pub(crate) fn sender(&self) -> RecordSender {
        self.sender.clone()
    }

    /// A way to have everything said so far readable in the file.
    pub(crate) fn flusher(&self) -> Flusher {
        Flusher { queue: self.sender.queue.clone(), path: self.path.clone() }
    }
}

impl Drop for Recorder {
    /// Ends the file with its index.
    fn drop(&mut self) {
        // Either fails when the writer has ended by itself, and has said so.
        let _ = self.sender.queue.send(Order::Finish);
        if let Some(writer) = self.writer.take() {
            let _ = writer.join();
        }
    }
}

/// Makes the file complete up to now.
#[derive(Clone, Debug)]
pub(crate) struct Flusher {
    queue: SyncSender<Order>,
    path: PathBuf,
}

impl Flusher {
    /// Waits until everything said so far is in the file, and says where it lies. Blocks.
    pub(crate) fn flush(&self) -> PathBuf {
        let (done, wait) = mpsc::sync_channel(1);
        if self.queue.send(Order::Flush(done)).is_ok() {
            // An error means the writer ended and with it flushed all it had.
            let _ = wait.recv();
        }
        self.path.clone()
    }
}

/// The writer's side.
struct Desk {
    orders: Receiver<Order>,
    pressure: Arc<Pressure>,
    tape: Tape,
    bytes_max: u64,
}

impl Desk {
    fn run(mut self, news: &impl Fn(RecorderNews)) {
        match self.write_until_finished(news) {
            Ok(()) => {}
            Err(error) => news(RecorderNews::Failed(error.to_string())),
        }
    }

    fn write_until_finished(&mut self, news: &impl Fn(RecorderNews)) -> mcap::McapResult<()> {
        let started = clock::now();
        let mut flush_at = started + FLUSH_PERIOD;
        loop {
            let patience = flush_at.since(clock::now());
            match self.orders.recv_timeout(patience) {
                Ok(Order::Write(line)) => {
                    self.pressure.waiting_bytes.fetch_sub(line.cdr.len(), Ordering::Relaxed);
                    self.tape.write(&line)?;
                    if self.tape.bytes() >= self.bytes_max {
                        self.tape.finish()?;
                        news(RecorderNews::Full { bytes: self.tape.bytes() });
                        return Ok(());
                    }
                }
                Ok(Order::Flush(done)) => {
                    self.tape.flush()?;
                    // Whoever asked may have gone.
                    let _ = done.try_send(());
                }
                Ok(Order::Finish) | Err(mpsc::RecvTimeoutError::Disconnected) => {
                    return self.tape.finish();
                }
                Err(mpsc::RecvTimeoutError::Timeout) => {}
            }
            let now = clock::now();
            if now >= flush_at {
                self.tape.flush()?;
                let period = now.since(started) / 60;
                flush_at = now + period.clamp(FLUSH_PERIOD, FLUSH_PERIOD_MAX);
                match self.pressure.dropped.swap(0, Ordering::Relaxed) {
                    0 => {}
                    dropped => news(RecorderNews::Dropped(dropped)),
                }
            }
        }
    }
}

#[cfg(test)]
mod tests;
