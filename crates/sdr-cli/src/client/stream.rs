//! Answers that come in pieces: bytes of a log, server-sent events.

use http_body_util::{BodyExt, Full};
use hyper::{
    body::{Bytes, Incoming},
    client::conn::http1::SendRequest,
};

use super::ClientError;

/// Longest event that is read.
const EVENT_BYTES_MAX: usize = 1 << 20;

/// Bytes as they come.
pub(crate) struct Chunks {
    /// Held so that the connection stays open.
    _sender: SendRequest<Full<Bytes>>,
    body: Incoming,
    agent: String,
}

impl Chunks {
    pub(super) fn new(sender: SendRequest<Full<Bytes>>, body: Incoming, agent: String) -> Self {
        Self { _sender: sender, body, agent }
    }

    /// The next bytes, or `None` at the end.
    pub(crate) async fn next(&mut self) -> Result<Option<Bytes>, ClientError> {
        while let Some(frame) = self.body.frame().await {
            let frame = frame.map_err(|error| self.broken(&error.to_string()))?;
            if let Ok(bytes) = frame.into_data() {
                return Ok(Some(bytes));
            }
        }
        Ok(None)
    }

    fn broken(&self, reason: &str) -> ClientError {
        let agent = self.agent.clone();
        ClientError::Broken { agent, path: "a stream".into(), reason: reason.into() }
    }
}

/// Server-sent events as they come.
pub(crate) struct Events {
    chunks: Chunks,
    reader: EventReader,
}

impl Events {
    pub(super) fn new(chunks: Chunks) -> Self {
        Self { chunks, reader: EventReader::default() }
    }

    /// The next event, or `None` when the agent ended the stream.
    pub(crate) async fn next(&mut self) -> Result<Option<Message>, ClientError> {
        loop {
            if let Some(message) = self.reader.next() {
                return Ok(Some(message));
            }
            if self.reader.buffer.len() + self.reader.data.len() > EVENT_BYTES_MAX {
                return Err(self.chunks.broken("an event longer than 1 MiB"));
            }
            match self.chunks.next().await? {
                Some(bytes) => self.reader.buffer.extend_from_slice(&bytes),
                None => return Ok(None),
            }
        }
    }
}

/// One server-sent event.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub(crate) struct Message {
    /// The word of its `event:` line; empty for plain ones.
    pub(crate) kind: String,
    /// Its `data:` lines.
    pub(crate) data: String,
}

/// Takes events out of bytes, after <https://html.spec.whatwg.org/multipage/server-sent-events.html>.
#[derive(Debug, Default)]
struct EventReader {
    buffer: Vec<u8>,
    kind: String,
    data: String,
    any: bool,
}

impl EventReader {
    fn next(&mut self) -> Option<Message> {
        while let Some(end) = self.buffer.iter().position(|byte| *byte == b'\n') {
            let line: Vec<u8> = self.buffer.drain(..=end).collect();
            let line = String::from_utf8_lossy(&line);
            let line = line.trim_end_matches(['\n', '\r']);
            if !line.is_empty() {
                self.take(line);
            } else if let Some(message) = self.dispatch() {
                return Some(message);
            }
        }
        None
    }

    fn take(&mut self, line: &str) {
        let (field, value) = line.split_once(':').unwrap_or((line, ""));
        let value = value.strip_prefix(' ').unwrap_or(value);
        match field {
            "event" => self.kind = value.into(),
            "data" => {
                if self.any {
                    self.data.push('\n');
                }
                self.data.push_str(value);
                self.any = true;
            }
            // Comments (empty field) keep the connection alive; ids repeat what the data says.
            _ => {}
        }
    }

    fn dispatch(&mut self) -> Option<Message> {
        let kind = std::mem::take(&mut self.kind);
        let data = std::mem::take(&mut self.data);
        std::mem::take(&mut self.any).then_some(Message { kind, data })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn read(pieces: &[&[u8]]) -> Vec<Message> {
        let mut reader = EventReader::default();
        let mut messages = Vec::new();
        for piece in pieces {
            reader.buffer.extend_from_slice(piece);
            messages.extend(std::iter::from_fn(|| reader.next()));
        }
        messages
    }

    #[test]
    fn events_come_out_whole_however_the_bytes_are_cut() {
        let bytes =
            b":hello\n\nid: 1\ndata: {\"a\":1}\n\nevent: lagged\r\ndata: x\r\ndata: y\r\n\r\n";
        let whole = read(&[bytes]);
        let pieces: Vec<&[u8]> = bytes.chunks(1).collect();
        assert_eq!(whole, read(&pieces));
        assert_eq!(whole.len(), 2);
        assert_eq!(whole[0], Message { kind: String::new(), data: "{\"a\":1}".into() });
        assert_eq!(whole[1], Message { kind: "lagged".into(), data: "x\ny".into() });
    }

    #[test]
    fn an_event_without_its_empty_line_is_not_given_out() {
        assert_eq!(read(&[b"data: half\n"]), []);
        assert_eq!(read(&[b"\xff\xfe\n\n\n"]), []);
    }
}
