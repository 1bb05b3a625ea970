//! A Unix socket that answers HTTP from a table, as an agent would.

use std::{
    collections::BTreeMap,
    io::{Read, Write},
    os::unix::net::{UnixListener, UnixStream},
    path::PathBuf,
    sync::{Arc, Mutex},
    thread,
};

use serde_json::Value;

/// Answers by request line start, such as `GET /v1/status`; the last of several stays.
type Answers = Arc<Mutex<BTreeMap<String, Vec<(u16, String)>>>>;

/// The socket and what was asked there.
pub(crate) struct Agent {
    folder: tempfile::TempDir,
    answers: Answers,
    asked: Arc<Mutex<Vec<String>>>,
}

impl Agent {
    /// An agent that knows nothing yet.
    pub(crate) fn new() -> Self {
        let folder = tempfile::tempdir().unwrap();
        let listener = UnixListener::bind(folder.path().join("agent.sock")).unwrap();
        let answers = Answers::default();
        let asked = Arc::new(Mutex::new(Vec::new()));
        let (table, heard) = (answers.clone(), asked.clone());
        thread::spawn(move || {
            for stream in listener.incoming() {
                let Ok(stream) = stream else { return };
                answer(stream, &table, &heard);
            }
        });
        Self { folder, answers, asked }
    }

    /// The next answer to requests that begin with `request`.
    pub(crate) fn on(self, request: &str, status: u16, body: &Value) -> Self {
        self.on_text(request, status, &body.to_string())
    }

    /// The same with any body.
    pub(crate) fn on_text(self, request: &str, status: u16, body: &str) -> Self {
        let mut answers = self.answers.lock().unwrap();
        answers.entry(request.into()).or_default().push((status, body.into()));
        drop(answers);
        self
    }

    /// Its address.
    pub(crate) fn socket(&self) -> String {
        self.path().display().to_string()
    }

    fn path(&self) -> PathBuf {
        self.folder.path().join("agent.sock")
    }

    /// All requests so far: request line, an empty line, body.
    pub(crate) fn asked(&self) -> Vec<String> {
        self.asked.lock().unwrap().clone()
    }
}

fn answer(mut stream: UnixStream, answers: &Answers, asked: &Mutex<Vec<String>>) {
    let request = read(&mut stream);
    let mut answers = answers.lock().unwrap();
    let known = answers.iter_mut().rev().find(|(start, _)| request.starts_with(start.as_str()));
    let (status, body) = match known {
        Some((_, list)) if list.len() > 1 => list.remove(0),
        Some((_, list)) => list[0].clone(),
        None => (404, r#"{"error":"no such path"}"#.into()),
    };
    asked.lock().unwrap().push(request);
    let length = body.len();
    let head = format!("HTTP/1.1 {status} x\r\ncontent-length: {length}\r\n\r\n");
    // A client that went away is its own affair.
    let _ = stream.write_all((head + &body).as_bytes());
}

/// Request line and body.
fn read(stream: &mut UnixStream) -> String {
    let mut bytes = Vec::new();
    let mut piece = [0; 4096];
    loop {
        let text = String::from_utf8_lossy(&bytes).into_owned();
        if let Some((head, body)) = text.split_once("\r\n\r\n") {
            let length = head.to_ascii_lowercase();
            let length = length.split("content-length: ").nth(1).and_then(|rest| {
                rest.split("\r\n").next().and_then(|number| number.parse::<usize>().ok())
            });
            if body.len() >= length.unwrap_or(0) {
                return format!("{}\n\n{body}", head.split("\r\n").next().unwrap_or(""));
            }
        }
        match stream.read(&mut piece) {
            Ok(0) | Err(_) => return text,
            Ok(count) => bytes.extend_from_slice(&piece[..count]),
        }
    }
}
