//! One MCAP file that is readable at any moment.

use std::collections::{BTreeMap, HashMap};
use std::fs::File;
use std::io::{self, Seek, SeekFrom, Write};
use std::path::Path;
use std::sync::Arc;

use mcap::{McapResult, WriteOptions, Writer, records::MessageHeader};

use super::Line;
use crate::clock;

/// Largest chunk, bytes.
const CHUNK_BYTES: u64 = 256 << 10;

/// Data end, footer without summary, magic: what makes the file whole until more comes.
const ENDING: &[u8] = &[
    0x0f, 4, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, // data end, no checksum
    0x02, 20, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, // footer: no summary
    0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, // no offsets, no checksum
    0x89, b'M', b'C', b'A', b'P', 0x30, b'\r', b'\n',
];

/// Writes chunks and puts a provisional ending behind each flush, so that an agent that is
/// killed leaves a file that every reader opens.
pub(super) struct Tape {
    writer: Writer<Shared>,
    file: Shared,
    channels: HashMap<Arc<str>, u16>,
    sequence: u32,
    /// Wall time less monotonic time at the start: log times never jump with the wall clock.
    wall_offset_ns: u64,
    log_time_last_ns: u64,
    bytes: u64,
}

/// One file, held by the MCAP writer and by the tape.
#[derive(Clone)]
struct Shared(Arc<File>);

impl Write for Shared {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        (&*self.0).write(bytes)
    }

    fn flush(&mut self) -> io::Result<()> {
        (&*self.0).flush()
    }
}

impl Seek for Shared {
    fn seek(&mut self, to: SeekFrom) -> io::Result<u64> {
        (&*self.0).seek(to)
    }
}

impl Tape {
    /// A new file at `path`; what was there is replaced.
    pub(super) fn create(path: &Path) -> McapResult<Self> {
        let file = Shared(Arc::new(File::create(path)?));
        let writer = WriteOptions::new()
            .profile("ros2")
            .library(concat!("sdr-agent ", env!("CARGO_PKG_VERSION")))
            .chunk_size(Some(CHUNK_BYTES))
            .disable_seeking(true)
            .calculate_data_section_crc(false)
            .create(file.clone())?;
        let wall = u64::try_from(clock::wall().as_nanos()).unwrap_or(u64::MAX);
        let mut tape = Self {
            writer,
            file,
            channels: HashMap::new(),
            sequence: 0,
            wall_offset_ns: wall.saturating_sub(clock::now().as_nanos()),
            log_time_last_ns: 0,
            bytes: 0,
        };
        tape.flush()?;
        Ok(tape)
    }

    /// Bytes of all messages so far.
    pub(super) fn bytes(&self) -> u64 {
        self.bytes
    }

    /// Adds one message.
    pub(super) fn write(&mut self, line: &Line) -> McapResult<()> {
        let channel_id = match self.channels.get(&line.topic) {
            Some(id) => *id,
            None => self.add_channel(line)?,
        };
        self.sequence = self.sequence.wrapping_add(1);
        let publish_time = self.wall_offset_ns.saturating_add(line.monotonic_ns);
        // Threads overtake each other on their way here, and readers refuse a file without an
        // index whose log times go back.
        let log_time = publish_time.max(self.log_time_last_ns);
        self.log_time_last_ns = log_time;
        let header = MessageHeader { channel_id, sequence: self.sequence, log_time, publish_time };
        self.bytes += line.cdr.len() as u64;
        self.writer.write_to_known_channel(&header, &line.cdr)
    }

    /// Ends the chunk and makes the file whole.
    pub(super) fn flush(&mut self) -> McapResult<()> {
        self.writer.flush()?;
        let end = self.file.stream_position()?;
        self.file.write_all(ENDING)?;
        self.file.seek(SeekFrom::Start(end))?;
        Ok(())
    }

    /// Ends the file with its index. Nothing may be written after it.
    pub(super) fn finish(&mut self) -> McapResult<()> {
        self.writer.finish()?;
        let end = self.file.stream_position()?;
        self.file.0.set_len(end)?;
        Ok(())
    }

    fn add_channel(&mut self, line: &Line) -> McapResult<u16> {
        let schema =
            self.writer.add_schema(&line.type_name, "ros2msg", line.definition.as_bytes())?;
        let id = self.writer.add_channel(schema, &line.topic, "cdr", &BTreeMap::new())?;
        self.channels.insert(Arc::clone(&line.topic), id);
        Ok(id)
    }
}
