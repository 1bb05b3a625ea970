//! Reads agents' recordings (MCAP, CDR) into the messages they hold.

use std::{
    collections::BTreeMap,
    fs, io,
    path::{Path, PathBuf},
};

use byteorder::LittleEndian;
use mcap::{MessageStream, read::Options};
use sdr_core::recording::{
    ComponentSample, ConnectionSample, EventSample, OutputSample, Recorded, RobotMetrics,
};
use serde::{Deserialize, de::DeserializeOwned};
use thiserror::Error;

/// Largest recording that is read, bytes.
const FILE_BYTES_MAX: u64 = 4 << 30;
/// Most recordings in one report.
const FILES_MAX: usize = 256;
/// How deep folders are searched.
const DEPTH_MAX: usize = 4;
/// CDR, little endian: the first bytes of a body.
const ENCAPSULATION_BYTES: usize = 4;

/// Recordings that cannot be used.
#[derive(Debug, Error)]
pub(crate) enum ReadError {
    /// The operator gave a wrong path, or may not read it.
    #[error("cannot read {}: {source}", path.display())]
    Io {
        /// What was to be read.
        path: PathBuf,
        /// What the system said.
        source: io::Error,
    },
    /// The operator gave a folder without recordings.
    #[error("no recording (*.mcap) in {}", .0.display())]
    Nothing(PathBuf),
    /// Too much for one report.
    #[error("{} is too much for one report: {found}, at most {allowed}", path.display())]
    TooMuch {
        /// What is too much.
        path: PathBuf,
        /// What was found.
        found: String,
        /// What is allowed.
        allowed: String,
    },
    /// Not a recording of an agent.
    #[error("{} is no recording of an agent: {reason}", path.display())]
    Foreign {
        /// The file.
        path: PathBuf,
        /// What does not fit.
        reason: String,
    },
}

/// A place along the way, from a recorded `nav_msgs/msg/Odometry`.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Fix {
    /// CLOCK_MONOTONIC when it was recorded.
    pub(crate) monotonic_ns: u64,
    /// The topic it came by.
    pub(crate) topic: String,
    /// In the sender's frame, metres.
    pub(crate) x_m: f64,
    /// In the sender's frame, metres.
    pub(crate) y_m: f64,
}

/// What one robot heard on a recorded port of `std_msgs/msg/Bool`.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) struct Words {
    /// The topic it came by.
    pub(crate) topic: String,
    /// All of them.
    pub(crate) said: u64,
    /// Those that were `true`.
    pub(crate) yes: u64,
}

/// All messages of all files, by time.
#[derive(Debug, Default)]
pub(crate) struct Recordings {
    /// The files.
    pub(crate) files: Vec<PathBuf>,
    /// What a reader of the report should know of the files.
    pub(crate) notes: Vec<String>,
    /// Robots' figures.
    pub(crate) metrics: Vec<RobotMetrics>,
    /// Instances.
    pub(crate) components: Vec<ComponentSample>,
    /// Connections.
    pub(crate) connections: Vec<ConnectionSample>,
    /// Outputs.
    pub(crate) outputs: Vec<OutputSample>,
    /// Events.
    pub(crate) events: Vec<EventSample>,
    /// Places.
    pub(crate) fixes: Vec<Fix>,
    /// Words by recording and topic.
    pub(crate) words: Vec<Words>,
}

impl Recordings {
    /// Reads files, and the recordings in folders.
    pub(crate) fn read(paths: &[PathBuf]) -> Result<Self, ReadError> {
        let mut recordings = Self { files: find(paths)?, ..Self::default() };
        for path in recordings.files.clone() {
            recordings.read_file(&path)?;
        }
        recordings.metrics.sort_by_key(|message| message.monotonic_ns);
        recordings.components.sort_by_key(|message| message.monotonic_ns);
        recordings.connections.sort_by_key(|message| message.monotonic_ns);
        recordings.outputs.sort_by_key(|message| message.monotonic_ns);
        recordings.events.sort_by_key(|message| (message.monotonic_ns, message.sequence));
        recordings.fixes.sort_by_key(|fix| fix.monotonic_ns);
        Ok(recordings)
    }

    fn read_file(&mut self, path: &Path) -> Result<(), ReadError> {
        let tell = |source| ReadError::Io { path: path.to_owned(), source };
        let size = fs::metadata(path).map_err(tell)?.len();
        if size > FILE_BYTES_MAX {
            return Err(ReadError::TooMuch {
                path: path.to_owned(),
                found: format!("{} MB", size / 1_000_000),
                allowed: format!("{} MB", FILE_BYTES_MAX / 1_000_000),
            });
        }
        let bytes = fs::read(path).map_err(tell)?;
        let foreign = |reason: String| ReadError::Foreign { path: path.to_owned(), reason };
        let stream = MessageStream::new_with_options(&bytes, Options::IgnoreEndMagic.into())
            .map_err(|error| foreign(error.to_string()))?;
        let (mut counts, mut fixes) = (Counts::default(), Vec::new());
        let mut words = BTreeMap::new();
        for message in stream {
            let message = match message {
                Ok(message) => message,
                Err(error) if counts.known == 0 => return Err(foreign(error.to_string())),
                Err(error) => {
                    self.note(path, &format!("ends early ({error}); what came before is used"));
                    break;
                }
            };
            let schema = message.channel.schema.as_ref().map_or("", |schema| schema.name.as_str());
            let body = Body { schema, bytes: &message.data, log_time: message.log_time };
            if body.schema == "std_msgs/msg/Bool" {
                count_word(&body, &message.channel.topic, &mut words);
            } else {
                self.take(&body, &message.channel.topic, &mut counts, &mut fixes);
            }
        }
        if counts.known == 0 {
            return Err(foreign("it holds no message of type sdr_msgs/msg/...".to_owned()));
        }
        if counts.broken > 0 {
            self.note(path, &format!("{} messages cannot be decoded", counts.broken));
        }
        self.words.extend(words.into_values());
        // Log times are monotonic times plus a constant, which any of the agent's own tells.
        if let Some(offset) = counts.clock_offset_ns {
            self.fixes.extend(fixes.into_iter().map(|fix: Fix| Fix {
                monotonic_ns: fix.monotonic_ns.saturating_sub(offset),
                ..fix
            }));
        }
        Ok(())
    }

    fn take(&mut self, body: &Body<'_>, topic: &str, counts: &mut Counts, fixes: &mut Vec<Fix>) {
        match body.schema {
            RobotMetrics::TYPE => {
                if let Some(metrics) = body.push::<RobotMetrics>(&mut self.metrics, counts) {
                    counts.clock_offset_ns = body.log_time.checked_sub(metrics.monotonic_ns);
                }
            }
            ComponentSample::TYPE => drop(body.push(&mut self.components, counts)),
            ConnectionSample::TYPE => drop(body.push(&mut self.connections, counts)),
            OutputSample::TYPE => drop(body.push(&mut self.outputs, counts)),
            EventSample::TYPE => drop(body.push(&mut self.events, counts)),
            "nav_msgs/msg/Odometry" => match body.decode::<OdometryHead>() {
                Some(head) => fixes.push(Fix {
                    monotonic_ns: body.log_time,
                    topic: topic.to_owned(),
                    x_m: head.x,
                    y_m: head.y,
                }),
                None => counts.broken += 1,
            },
            _ => {}
        }
    }

    fn note(&mut self, path: &Path, note: &str) {
        let name = path.file_name().unwrap_or_default().to_string_lossy();
        self.notes.push(format!("{name}: {note}"));
    }
}

fn count_word(body: &Body<'_>, topic: &str, words: &mut BTreeMap<String, Words>) {
    let Some(yes) = body.decode::<bool>() else { return };
    let fresh = || Words { topic: topic.to_owned(), said: 0, yes: 0 };
    let word = words.entry(topic.to_owned()).or_insert_with(fresh);
    word.said += 1;
    word.yes += u64::from(yes);
}

#[derive(Default)]
struct Counts {
    known: u64,
    broken: u64,
    clock_offset_ns: Option<u64>,
}

struct Body<'a> {
    schema: &'a str,
    bytes: &'a [u8],
    log_time: u64,
}

impl Body<'_> {
    fn decode<T: DeserializeOwned>(&self) -> Option<T> {
        let bytes = self.bytes.get(ENCAPSULATION_BYTES..)?;
        cdr_encoding::from_bytes::<T, LittleEndian>(bytes).ok().map(|(value, _later)| value)
    }

    /// Decodes and keeps it; `None` when it cannot be decoded.
    fn push<'l, T: DeserializeOwned>(
        &self,
        list: &'l mut Vec<T>,
        counts: &mut Counts,
    ) -> Option<&'l T> {
        match self.decode::<T>() {
            Some(value) => {
                counts.known += 1;
                list.push(value);
                list.last()
            }
            None => {
                counts.broken += 1;
                None
            }
        }
    }
}

/// The beginning of `nav_msgs/msg/Odometry`, as far as the place.
#[derive(Deserialize)]
struct OdometryHead {
    _stamp: (i32, u32),
    _frame_id: String,
    _child_frame_id: String,
    x: f64,
    y: f64,
}

/// The recordings among `paths`, each once, by name.
fn find(paths: &[PathBuf]) -> Result<Vec<PathBuf>, ReadError> {
    let mut found = BTreeMap::new();
    for path in paths {
        let before = found.len();
        let tell = |source| ReadError::Io { path: path.clone(), source };
        if fs::metadata(path).map_err(tell)?.is_dir() {
            search(path, DEPTH_MAX, &mut found)?;
            if found.len() == before {
                return Err(ReadError::Nothing(path.clone()));
            }
        } else {
            insert(path, &mut found)?;
        }
    }
    Ok(found.into_values().collect())
}

fn search(
    folder: &Path,
    depth: usize,
    found: &mut BTreeMap<PathBuf, PathBuf>,
) -> Result<(), ReadError> {
    let tell = |source| ReadError::Io { path: folder.to_owned(), source };
    for entry in fs::read_dir(folder).map_err(tell)? {
        let entry = entry.map_err(tell)?;
        let (path, kind) = (entry.path(), entry.file_type().map_err(tell)?);
        if kind.is_dir() && depth > 0 {
            search(&path, depth - 1, found)?;
        } else if kind.is_file() && path.extension().is_some_and(|word| word == "mcap") {
            insert(&path, found)?;
        }
    }
    Ok(())
}

/// Adds a file under its real path, so that one given twice counts once.
fn insert(path: &Path, found: &mut BTreeMap<PathBuf, PathBuf>) -> Result<(), ReadError> {
    let real =
        fs::canonicalize(path).map_err(|source| ReadError::Io { path: path.to_owned(), source })?;
    found.entry(real).or_insert_with(|| path.to_owned());
    if found.len() > FILES_MAX {
        let allowed = FILES_MAX.to_string();
        let found = format!("more than {FILES_MAX} recordings");
        return Err(ReadError::TooMuch { path: path.to_owned(), found, allowed });
    }
    Ok(())
}
