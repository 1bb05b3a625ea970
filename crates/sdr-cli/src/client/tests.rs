//! A socket with canned replies.

use std::sync::{Arc, Mutex};

use sdr_core::api::{DeployAnswer, StatusView};
use tokio::{
    io::{AsyncReadExt, AsyncWriteExt},
    net::UnixListener,
};

use super::*;
use crate::{failure::Failure, render::fixture};

/// A listener that answers every connection with these bytes.
struct Canned {
    folder: tempfile::TempDir,
    asked: Arc<Mutex<String>>,
}

impl Canned {
    /// Answers with `reply` and hangs up.
    fn new(reply: impl Into<Vec<u8>>) -> Self {
        let folder = tempfile::tempdir().unwrap();
        let listener = UnixListener::bind(folder.path().join("agent.sock")).unwrap();
        let asked = Arc::new(Mutex::new(String::new()));
        let (reply, heard) = (reply.into(), asked.clone());
        tokio::spawn(async move {
            while let Ok((mut stream, _)) = listener.accept().await {
                let mut request = vec![0; 4096];
                let length = stream.read(&mut request).await.unwrap_or(0);
                *heard.lock().unwrap() = String::from_utf8_lossy(&request[..length]).into();
                let _ = stream.write_all(&reply).await;
            }
        });
        Self { folder, asked }
    }

    /// Answers with this status and body.
    fn http(status: &str, body: &str) -> Self {
        let length = body.len();
        Self::new(format!("HTTP/1.1 {status}\r\ncontent-length: {length}\r\n\r\n{body}"))
    }

    fn client(&self) -> Client {
        Client::at(self.folder.path().join("agent.sock"))
    }

    async fn refusal(&self) -> String {
        let error = self.client().get::<StatusView>("/v1/status").await.unwrap_err();
        let Failure::Failed(answer) = Failure::from(error) else {
            panic!("failed, not wrong usage")
        };
        answer.error
    }
}

#[tokio::test]
async fn a_view_travels_as_json() {
    let view = fixture::fleet();
    let server = Canned::http("200 OK", &serde_json::to_string(&view).unwrap());
    let got: StatusView = server.client().get("/v1/status").await.unwrap();
    assert_eq!(got, view);
    assert!(server.asked.lock().unwrap().starts_with("GET /v1/status HTTP/1.1\r\n"));
}

#[tokio::test]
async fn a_request_carries_its_body() {
    let server = Canned::http("200 OK", r#"{"system":"a","revision":2,"changed":true}"#);
    let answer: DeployAnswer = server.client().post("/v1/deploy", &[1, 2]).await.unwrap();
    assert_eq!(answer.revision, 2);
    let asked = server.asked.lock().unwrap().clone();
    assert!(asked.starts_with("POST /v1/deploy") && asked.ends_with("\r\n\r\n[1,2]"), "{asked}");
}

#[tokio::test]
async fn a_refusal_keeps_the_agents_words_and_details() {
    let body = r#"{"error":"no such system","details":{"known":"a, b"}}"#;
    let server = Canned::http("404 Not Found", body);
    let error = server.client().delete("/v1/systems/c").await.unwrap_err();
    let ClientError::Refused { status, answer } = error else { panic!("{error:?}") };
    assert_eq!((status, answer.error.as_str()), (404, "no such system"));
    assert_eq!(answer.details["known"], "a, b");
}

#[tokio::test]
async fn garbage_becomes_a_sentence() {
    let long = format!("HTTP/1.1 200 OK\r\ncontent-length: {}\r\n\r\n", usize::MAX);
    let replies: [(&[u8], &str); 7] = [
        (b"", "no usable answer"),
        (b"\x00\xff\xfe garbage\r\n\r\n", "no usable answer"),
        (b"HTTP/1.1 200 OK\r\ncontent-length: 100\r\n\r\n{\"a\":", "no usable answer"),
        (b"HTTP/1.1 200 OK\r\ncontent-length: 2\r\n\r\n{}", "cannot be read"),
        (b"HTTP/1.1 200 OK\r\ncontent-length: 5\r\n\r\n\xff\x1b[2J", "cannot be read"),
        (b"HTTP/1.1 500 Oh\r\ncontent-length: 2\r\n\r\nno", "status 500"),
        (long.as_bytes(), "no usable answer"),
    ];
    for (reply, expected) in replies {
        let text = Canned::new(reply).refusal().await;
        assert!(text.contains(expected), "{}: {text}", String::from_utf8_lossy(reply));
        assert!(!text.contains('\u{1b}'), "{text:?}");
    }
}

#[tokio::test]
async fn an_endless_answer_is_cut_off() {
    let body = "x".repeat(ANSWER_BYTES_MAX + 1);
    let text = Canned::http("200 OK", &body).refusal().await;
    assert!(text.contains("larger than 16 MiB"), "{text}");
}

#[tokio::test]
async fn a_mute_agent_is_given_up() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("agent.sock");
    let _listener = UnixListener::bind(&path).unwrap();
    let mut client = Client::at(&path);
    client.within = Duration::from_millis(20);
    let error = client.get::<StatusView>("/v1/status").await.unwrap_err();
    assert!(error.to_string().contains("did not answer /v1/status within 0.02 s"), "{error}");
}

#[tokio::test]
async fn nobody_at_the_socket_is_told_with_what_to_do() {
    let folder = tempfile::tempdir().unwrap();
    let client = Client::at(folder.path().join("none.sock"));
    let text = client.get::<StatusView>("/v1/status").await.unwrap_err().to_string();
    assert!(text.starts_with("no agent at "), "{text}");
    assert!(text.contains("Start it:   sudo systemctl start sdr-agent"), "{text}");
}

#[tokio::test]
async fn events_come_one_by_one_and_end_with_the_stream() {
    let body = ": hello\n\ndata: one\n\nevent: lagged\ndata: 3\n\n";
    let server = Canned::http("200 OK", body);
    let mut events = server.client().events("/v1/events?follow=true").await.unwrap();
    assert_eq!(events.next().await.unwrap().unwrap().data, "one");
    assert_eq!(events.next().await.unwrap().unwrap().kind, "lagged");
    assert_eq!(events.next().await.unwrap(), None);
}

#[tokio::test]
async fn a_refused_stream_is_a_refusal() {
    let body = r#"{"error":"fisheye runs on robot-3","details":{"home":"robot-3","api":"/x"}}"#;
    let server = Canned::http("404 Not Found", body);
    match server.client().stream("/v1/logs/a/b").await {
        Err(ClientError::Refused { answer, .. }) => assert_eq!(answer.details["home"], "robot-3"),
        Err(other) => panic!("{other:?}"),
        Ok(_) => panic!("a refusal is no stream"),
    }
}
