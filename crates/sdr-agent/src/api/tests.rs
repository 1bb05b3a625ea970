//! A real server on a real socket; the loop's part is played by the test.

use std::io::{Read as _, Write as _};
use std::os::unix::net::UnixStream as Client;
use std::time::Duration;

use sdr_core::{
    api::{DeployAnswer, ErrorAnswer},
    event::Event,
};
use serde_json::{Value, json};
use tempfile::TempDir;

use super::*;
use crate::installed::tests::facts;

struct Bench {
    dir: TempDir,
    api: Api,
    state: ApiState,
    inputs: mpsc::Receiver<Input>,
    questions: mpsc::Receiver<Question>,
}

impl Bench {
    async fn new() -> Self {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("agent.sock");
        let robot = RobotId::new("robot-1").unwrap();
        let events = Events::new(robot.clone());
        let (sender, inputs) = mpsc::channel(16);
        let (asker, questions) = mpsc::channel(16);
        let bin = vec![dir.path().join("bin")];
        let state = ApiState {
            robot,
            installed: Installed::new((bin.clone(), vec![]), facts(), sender.clone()),
            inputs: sender,
            questions: asker,
            desk: AnswerDesk::default(),
            trouble: Trouble::new(events.clone()),
            events,
            plan: LatestPlan::default(),
            routes: Arc::default(),
            logs: LogFiles { dir: dir.path().into(), each_bytes_max: 1 << 20, bytes_max: 1 << 20 },
            recording: None,
            profiles: Profiles::new(bin),
            keys: None,
            streams: None,
            ending: watch::channel(Ending::NotYet).0,
        };
        let listener = open(&path).await.unwrap();
        let api = Api::start(path, listener, None, state.clone());
        Self { dir, api, state, inputs, questions }
    }

    /// Sends a request without waiting for its answer.
    fn ask(&self, method: &str, path: &str, body: &str) -> Client {
        let mut client = Client::connect(&self.api.path).unwrap();
        let length = body.len();
        let head = format!("{method} {path} HTTP/1.1\r\nhost: x\r\ncontent-length: {length}\r\n");
        let request = format!("{head}connection: close\r\n\r\n{body}");
        client.write_all(request.as_bytes()).unwrap();
        client
    }

    async fn get(&self, path: &str) -> (u16, String) {
        answer(self.ask("GET", path, "")).await
    }

    /// Puts a shell script among the executables.
    fn install(&self, name: &str, text: &str) {
        let bin = self.dir.path().join("bin");
        fs::create_dir_all(&bin).unwrap();
        fs::write(bin.join(name), format!("#!/bin/sh\n{text}\n")).unwrap();
        fs::set_permissions(bin.join(name), fs::Permissions::from_mode(0o755)).unwrap();
    }

    /// Answers the next question for the status with robot-2 as the home of `mapping/lidar`.
    async fn tell_status(&mut self) {
        match self.questions.recv().await.unwrap() {
            Question::Status(asker) => asker.send(status()).unwrap(),
            Question::Mesh(_) => panic!("another question"),
        }
    }
}

fn status() -> StatusView {
    let robot = |name: &str| {
        json!({
            "name": name, "alive": true, "seen_ms": 0, "coordinator": false, "cpu_permille": 0,
            "memory_free_bytes": 0, "memory_capacity_bytes": 0, "battery_permille": null,
            "rssi_dbm": null, "rtt_ms": null, "api": format!("/run/{name}.sock"), "conditions": []
        })
    };
    let component = |name: &str, home: Value| {
        json!({
            "name": name, "home": home, "state": null, "epoch": 0, "epoch_minted_by": null,
            "run": 0, "restarts": 0, "memory_bytes": 0, "cpu_permille": 0, "standbys": [],
            "reason": ""
        })
    };
    let components = [
        component("lidar", json!("robot-2")),
        component("map", json!("robot-1")),
        component("nav", json!(null)),
    ];
    serde_json::from_value(json!({
        "seen_from": "robot-1", "coordinator": "robot-1", "term": 1,
        "robots": [robot("robot-1"), robot("robot-2")],
        "systems": [{ "name": "mapping", "revision": 1, "components": components, "connections": [] }],
        "conditions": []
    }))
    .unwrap()
}

/// Status and body; chunks are joined.
async fn answer(mut client: Client) -> (u16, String) {
    let text = tokio::task::spawn_blocking(move || {
        let mut text = String::new();
        client.read_to_string(&mut text).unwrap();
        text
    });
    let text = text.await.unwrap();
    let (head, body) = text.split_once("\r\n\r\n").unwrap();
    (head.split(' ').nth(1).unwrap().parse().unwrap(), body.to_string())
}

fn error_of(body: &str) -> ErrorAnswer {
    serde_json::from_str(body).unwrap()
}

#[tokio::test]
async fn the_status_is_what_the_loop_says() {
    let mut bench = Bench::new().await;
    let client = bench.ask("GET", "/v1/status", "");

    bench.tell_status().await;

    let (code, body) = answer(client).await;
    assert_eq!(code, 200);
    assert_eq!(serde_json::from_str::<StatusView>(&body).unwrap(), status());
}

#[tokio::test]
async fn health_has_the_counters_of_the_mesh_and_of_each_route() {
    let mut bench = Bench::new().await;
    bench.state.routes.open("tunnel/fisheye/image", crate::data::Way::Out).forwarded.add(7);
    let client = bench.ask("GET", "/v1/health", "");

    match bench.questions.recv().await.unwrap() {
        Question::Mesh(asker) => {
            let counted = MeshCounters { received: 9, malformed: 1, ..MeshCounters::default() };
            asker.send(counted).unwrap();
        }
        Question::Status(_) => panic!("another question"),
    }

    let (code, body) = answer(client).await;
    let view: Value = serde_json::from_str(&body).unwrap();
    assert_eq!((code, &view["mesh"]["received"]), (200, &json!(9)), "{body}");
    assert_eq!((&view["mesh"]["malformed"], &view["mesh"]["sent"]), (&json!(1), &json!(0)));
    let route = &view["routes"][0];
    assert_eq!((&route["path"], &route["way"]), (&json!("tunnel/fisheye/image"), &json!("out")));
    assert_eq!((&route["forwarded"], &route["dropped_rate"]), (&json!(7), &json!(0)));
}

#[tokio::test]
async fn every_refusal_is_json_that_says_what_is_allowed() {
    let bench = Bench::new().await;
    for (method, path, body, code, wanted) in [
        ("GET", "/v2/status", "", 404, "there are /v1/status"),
        ("PUT", "/v1/deploy", "", 405, "POST is for /v1/deploy"),
        ("POST", "/v1/deploy", "{\"system\": {\n  nonsense", 400, "at line 2 column 3"),
        ("DELETE", "/v1/systems/Not-A-Name", "", 400, "[a-z][a-z0-9_]*"),
        ("GET", "/v1/events?since=never", "", 400, "allowed: since=NUMBER"),
        ("GET", "/v1/logs/mapping/lidar?tail=5", "", 400, "allowed: lines=NUMBER"),
        ("GET", "/v1/recording", "", 404, "[storage] recordings"),
    ] {
        let (found, body) = answer(bench.ask(method, path, body)).await;
        assert_eq!(found, code, "{method} {path}: {body}");
        assert!(error_of(&body).error.contains(wanted), "{method} {path}: {body}");
    }
    assert_eq!(bench.state.trouble.counters()["api_requests_bad"], 6);
}

#[tokio::test]
async fn a_body_beyond_the_bound_is_refused_before_it_comes() {
    let bench = Bench::new().await;
    let mut client = Client::connect(&bench.api.path).unwrap();
    let length = SYSTEM_BYTES_MAX + 1;
    let head = "POST /v1/deploy HTTP/1.1\r\nhost: x\r\ncontent-length";

    let read = tokio::task::spawn_blocking(move || {
        // Not a byte of the body follows.
        client.write_all(format!("{head}: {length}\r\n\r\n").as_bytes()).unwrap();
        let mut bytes = [0; 4096];
        let length = client.read(&mut bytes).unwrap();
        String::from_utf8_lossy(&bytes[..length]).into_owned()
    });

    let text = read.await.unwrap();
    assert!(text.starts_with("HTTP/1.1 413"), "{text}");
    assert!(text.contains("larger than 16777216 bytes"), "{text}");
}

#[tokio::test]
async fn a_system_that_contradicts_itself_never_reaches_the_brain() {
    let mut bench = Bench::new().await;
    let system = json!({
        "name": "mapping", "components": [], "connections": [],
        "allocation": { "name": "", "bytes": [] }, "recovery": { "name": "", "bytes": [] }
    });
    let body = json!({ "system": system }).to_string();

    let (code, body) = answer(bench.ask("POST", "/v1/deploy", &body)).await;

    assert_eq!(code, 422);
    assert!(error_of(&body).error.contains("at least one component"), "{body}");
    assert!(bench.inputs.try_recv().is_err());
}

#[tokio::test]
async fn what_was_installed_a_moment_ago_is_told_before_the_deployment() {
    let mut bench = Bench::new().await;
    bench.install("camera", "exit 0");
    let file = bench.dir.path().join("eye.yaml");
    let text = "system: eye\ncomponents:\n  camera:\n    run: { native: camera }\n    needs: { memory: 10MB, cpu: 5% }\n";
    fs::write(&file, text).unwrap();
    let system = sdr_files::load_system(&file).unwrap().spec;

    let client = bench.ask("POST", "/v1/deploy", &json!({ "system": system }).to_string());

    let Input::Facts(facts) = bench.inputs.recv().await.unwrap() else { panic!("no facts") };
    assert_eq!(facts.launchables, [sdr_core::spec::launch_hash("camera")]);
    let Input::Deploy { request, .. } = bench.inputs.recv().await.unwrap() else {
        panic!("no deployment")
    };
    let said = DeployAnswer { system: "eye".into(), revision: 1, changed: true };
    bench.state.desk.answer(request, Ok(Accepted::System(said)));
    assert_eq!(answer(client).await.0, 200);
}

#[tokio::test]
async fn a_wish_is_answered_by_the_brain() {
    let mut bench = Bench::new().await;
    for (said, code, wanted) in [
        (
            Ok(Accepted::System(DeployAnswer {
                system: "mapping".into(),
                revision: 3,
                changed: true,
            })),
            200,
            "\"revision\":3",
        ),
        (Err("no system mapping".to_string()), 409, "no system mapping"),
    ] {
        let client = bench.ask("DELETE", "/v1/systems/mapping", "");
        let Input::Undeploy { request, .. } = bench.inputs.recv().await.unwrap() else {
            panic!("another input")
        };
        bench.state.desk.answer(request, said);
        let (found, body) = answer(client).await;
        assert_eq!(found, code);
        assert!(body.contains(wanted), "{body}");
    }
}

#[tokio::test]
async fn events_are_listed_and_followed_without_a_gap() {
    let bench = Bench::new().await;
    let say = |kind: &str| bench.state.events.publish(bench.state.events.new_event(kind, "why"));
    say("first");
    say("second");

    let (_, body) = bench.get("/v1/events?since=1").await;
    let listed: Vec<sdr_core::api::EventView> = serde_json::from_str(&body).unwrap();
    assert_eq!(listed.len(), 1);
    assert_eq!(listed[0].event.kind, "second");

    let mut client = bench.ask("GET", "/v1/events?since=1&follow=true", "");
    let mut text = String::new();
    let mut said_third = false;
    while !text.contains("\"third\"") {
        let read = tokio::task::spawn_blocking(move || {
            let mut bytes = [0; 4096];
            let length = client.read(&mut bytes).unwrap();
            (client, String::from_utf8_lossy(&bytes[..length]).into_owned())
        });
        let (back, more) = read.await.unwrap();
        client = back;
        text.push_str(&more);
        if !said_third && text.contains("\"second\"") {
            said_third = true;
            say("third");
        }
    }
    assert!(!text.contains("\"first\""));
    assert!(text.contains("id: 2\n") && text.contains("id: 3\n"), "{text}");
}

#[tokio::test]
async fn a_follower_that_is_too_slow_is_dropped_with_a_note() {
    let bench = Bench::new().await;
    let mut client = bench.ask("GET", "/v1/events?follow=true", "");
    // Wait for the head, so that it follows; then say more than it may fall behind.
    let head = tokio::task::spawn_blocking(move || {
        let mut bytes = [0; 1024];
        let length = client.read(&mut bytes).unwrap();
        assert!(bytes[..length].starts_with(b"HTTP/1.1 200"));
        client
    });
    let client = head.await.unwrap();
    let long = "why ".repeat(1000);
    for _ in 0..2000 {
        bench.state.events.publish(Event::new("flood", &bench.state.robot, long.as_str()));
    }

    let (code, body) = tokio::task::spawn_blocking(move || {
        let mut client = client;
        let mut text = String::new();
        client.read_to_string(&mut text).unwrap();
        (200, text)
    })
    .await
    .unwrap();

    assert_eq!(code, 200);
    assert!(body.contains("event: lagged"), "{}", body.len());
}

#[tokio::test]
async fn a_log_is_served_at_its_home_and_pointed_to_elsewhere() {
    let mut bench = Bench::new().await;
    fs::write(bench.dir.path().join("mapping.map.log"), "one\ntwo\nthree\n").unwrap();

    let client = bench.ask("GET", "/v1/logs/mapping/map?lines=2", "");
    bench.tell_status().await;
    assert_eq!(answer(client).await, (200, "two\nthree\n".into()));

    let client = bench.ask("GET", "/v1/logs/mapping/lidar", "");
    bench.tell_status().await;
    let (code, body) = answer(client).await;
    assert_eq!(code, 404);
    assert_eq!(error_of(&body).details["home"], "robot-2");
    assert_eq!(error_of(&body).details["api"], "/run/robot-2.sock");

    for (name, wanted) in [("nav", "no home yet"), ("radar", "no component mapping/radar")] {
        let client = bench.ask("GET", &format!("/v1/logs/mapping/{name}"), "");
        bench.tell_status().await;
        let (code, body) = answer(client).await;
        assert_eq!(code, 404);
        assert!(error_of(&body).error.contains(wanted), "{body}");
    }
}

#[tokio::test]
async fn executables_describe_themselves_once() {
    let bench = Bench::new().await;
    let count = bench.dir.path().join("count");
    let profile = r#"{"name":"lidar","inputs":[],"outputs":[]}"#;
    bench.install("lidar", &format!("echo ran >> {}; echo '{profile}'", count.display()));
    bench.install("other", "exit 4");
    bench.install("library.so", "exit 0");

    for _ in 0..2 {
        let (_, body) = bench.get("/v1/components").await;
        let view: Value = serde_json::from_str(&body).unwrap();
        assert_eq!(view["components"][0]["name"], "lidar");
        assert_eq!(view["components"].as_array().unwrap().len(), 1);
        let reasons = view["undescribed"].as_object().unwrap();
        assert_eq!(reasons.len(), 1);
        assert!(reasons["other"].as_str().unwrap().contains("exit status: 4"));
    }
    assert_eq!(fs::read_to_string(count).unwrap(), "ran\n");
}

#[tokio::test]
async fn a_living_agents_socket_is_not_taken_and_a_dead_ones_is() {
    let bench = Bench::new().await;
    assert!(matches!(open(&bench.api.path).await, Err(ApiError::Taken(_))));

    let dead = bench.dir.path().join("dead.sock");
    drop(std::os::unix::net::UnixListener::bind(&dead).unwrap());
    let listener = open(&dead).await.unwrap();
    let mode = fs::metadata(&dead).unwrap().permissions().mode();
    assert_eq!(mode & 0o777, 0o660);
    drop(listener);

    bench.api.stop();
    while bench.api.path.exists() {
        tokio::time::sleep(Duration::from_millis(1)).await;
    }
}
