//! Real processes, a real socket. The component is this test binary, started again.

mod adoption;
mod component;
mod hangs;

use std::io::{Read as _, Write as _};
use std::os::unix::net::UnixStream;
use std::time::Duration;
use std::{env, fs};

use sdr_core::{
    id::{Name, RobotId},
    lifecycle::LifecycleState,
    order::{Epoch, Token},
    recover::Cause,
    spec::{
        ComponentSpec, Execution, Isolation, IsolationAction, Launch, Limits, Needs, Place,
        Standby, Value,
    },
};
use tempfile::TempDir;
use tokio::task::LocalSet;

use super::*;
use crate::events::Events;

fn robot() -> RobotId {
    RobotId::new("robot-1").unwrap()
}

fn key() -> ComponentKey {
    ComponentKey::new(&Name::new("mapping").unwrap(), &Name::new("lidar").unwrap())
}

fn config(dir: &TempDir) -> SupervisorConfig {
    let own = env::current_exe().unwrap();
    let patience = Patience {
        hello: Duration::from_millis(600),
        finish: Duration::from_millis(200),
        terminate: Duration::from_millis(200),
        order: Duration::from_millis(600),
        beat_idle: Duration::from_secs(600),
        ..Patience::default()
    };
    SupervisorConfig {
        path: vec![dir.path().join("bin"), own.parent().unwrap().into()],
        socket: dir.path().join("c.sock"),
        state: dir.path().into(),
        logs: LogFiles {
            dir: dir.path().join("logs"),
            each_bytes_max: 1 << 20,
            bytes_max: 1 << 20,
        },
        on_agent_death: OnAgentDeath::Stop,
        devices: BTreeMap::from([("wheels".into(), "/dev/wheels0".into())]),
        memory: SharedMemory { prefix: "t_".into(), root: "/dev/shm/t/".into() },
        cgroup: Cgroup::Off,
        patience,
    }
}

fn token(run: u32) -> Token {
    Token { epoch: Epoch::first(&robot()), run }
}

/// A supervisor and everything round it.
struct Bench {
    dir: TempDir,
    supervisor: Supervisor,
    /// What the brain would be told first.
    adopted: Vec<Input>,
    inputs: mpsc::Receiver<Input>,
    events: Events,
    trouble: Trouble,
}

impl Bench {
    fn new() -> Self {
        Self::with(|_| {})
    }

    fn with(change: impl FnOnce(&mut Patience)) -> Self {
        let dir = tempfile::tempdir().unwrap();
        fs::create_dir(dir.path().join("bin")).unwrap();
        let mut config = config(&dir);
        change(&mut config.patience);
        Self::open(dir, config)
    }

    /// What an agent finds that starts where another one died.
    fn again(dir: TempDir) -> Self {
        let config = config(&dir);
        Self::open(dir, config)
    }

    fn open(dir: TempDir, config: SupervisorConfig) -> Self {
        let events = Events::new(robot());
        let trouble = Trouble::new(events.clone());
        let (sender, inputs) = mpsc::channel(256);
        let outlets = Outlets {
            inputs: sender,
            watch: Watch::default(),
            record: RecordSender::nowhere(&robot()),
            trouble: trouble.clone(),
            types: PortTypes::default(),
        };
        let survivors = find_survivors(&config, &events);
        let (supervisor, adopted) = Supervisor::start(config, outlets, survivors).unwrap();
        Self { dir, supervisor, adopted, inputs, events, trouble }
    }

    /// A shell script as an executable.
    fn script(&self, name: &str, lines: &str) {
        use std::os::unix::fs::PermissionsExt as _;
        let path = self.dir.path().join("bin").join(name);
        fs::write(&path, format!("#!/bin/sh\n{lines}\n")).unwrap();
        fs::set_permissions(path, fs::Permissions::from_mode(0o755)).unwrap();
    }

    fn launch(&self, instance: InstanceId, executable: &str) {
        self.supervisor.launch(order(instance, executable, Vec::new(), ""));
    }

    /// Starts this test binary as a component that behaves as `manner` says.
    fn launch_component(&self, instance: InstanceId, manner: &str) {
        let own = env::current_exe().unwrap();
        let name = own.file_name().unwrap().to_str().unwrap();
        let role = "supervisor::tests::component::the_component_of_these_tests";
        let arguments = ["--exact", role, "--nocapture"].map(String::from).to_vec();
        let mut order = order(instance, name, arguments, manner);
        order.spec.on_agent_death = (manner == "loyal").then_some(OnAgentDeath::Keep);
        self.supervisor.launch(order);
    }

    /// The next news of `instance`.
    async fn news(&mut self, instance: InstanceId) -> InstanceNews {
        loop {
            let input = self.inputs.recv().await.unwrap();
            if let Input::Instance { instance: of, news } = input
                && of == instance
            {
                return news;
            }
        }
    }

    async fn until_state(&mut self, instance: InstanceId, wanted: LifecycleState) {
        loop {
            let news = self.news(instance).await;
            if matches!(news, InstanceNews::State { state, .. } if state == wanted) {
                return;
            }
            assert!(!matches!(news, InstanceNews::Exited { .. }), "{news:?}");
        }
    }

    async fn until_hung(&mut self, instance: InstanceId) -> String {
        loop {
            let news = self.news(instance).await;
            let ended =
                matches!(news, InstanceNews::Exited { .. } | InstanceNews::OutOfMemory { .. });
            assert!(!ended, "{news:?}");
            if let InstanceNews::Hung { reason } = news {
                return reason;
            }
        }
    }

    async fn until_exit(&mut self, instance: InstanceId) -> String {
        loop {
            if let InstanceNews::Exited { reason } = self.news(instance).await {
                return reason;
            }
        }
    }
}

pub(crate) fn order(
    instance: InstanceId,
    executable: &str,
    arguments: Vec<String>,
    manner: &str,
) -> LaunchOrder {
    let spec = ComponentSpec {
        name: key().name,
        index: 0,
        launch: Launch::Native { executable: executable.into(), arguments },
        needs: Needs::default(),
        execution: Execution::Periodic { period: Duration::from_millis(20) },
        devices: vec![Name::new("wheels").unwrap()],
        place: Place::default(),
        after: Vec::new(),
        actuator: false,
        on_isolation: Isolation { action: IsolationAction::Continue, after: Duration::ZERO },
        standby: Standby::default(),
        parameters: vec![("manner".into(), Value::Text(manner.into()))],
        on_agent_death: None,
        limits: Limits::default(),
    };
    LaunchOrder { instance, component: key(), spec, inputs: Vec::new(), output_depth: 8 }
}

fn run<F: Future>(test: F) -> F::Output {
    let runtime = tokio::runtime::Builder::new_current_thread().enable_all().build().unwrap();
    LocalSet::new().block_on(&runtime, test)
}

#[test]
fn a_component_is_configured_commanded_and_finished() {
    run(async {
        let mut bench = Bench::new();
        bench.launch_component(1, "good");
        assert!(matches!(bench.news(1).await, InstanceNews::Started { pid } if pid > 0));
        // Before it has greeted: kept for it.
        bench.supervisor.command(1, Command::Activate(token(4)));
        bench.until_state(1, LifecycleState::Inactive).await;
        let active = bench.news(1).await;
        assert!(matches!(active, InstanceNews::State { token: Some(one), .. } if one == token(4)));

        bench.supervisor.command(1, Command::Reset);
        let news = bench.news(1).await;
        let worn = Some((Cause::Error, "worn out".into()));
        assert!(matches!(news, InstanceNews::State { fault, .. } if fault == worn));

        bench.supervisor.command(1, Command::Finish);
        assert!(bench.until_exit(1).await.starts_with("exit status 0"));
        assert!(bench.supervisor.shared.kept.borrow().is_empty());
        assert!(journal::read(bench.dir.path()).entries.is_empty());
    });
}

#[test]
fn a_crash_is_told_with_its_last_words() {
    run(async {
        let mut bench = Bench::new();
        bench.launch_component(1, "crash");
        bench.supervisor.command(1, Command::Activate(token(1)));

        bench.until_state(1, LifecycleState::Active).await;
        let reason = bench.until_exit(1).await;

        assert!(reason.starts_with("exit status 101; last output: "), "{reason}");
        assert!(reason.contains("the lidar is on fire"), "{reason}");
    });
}

#[test]
fn an_exit_is_told_with_its_status_and_at_most_five_lines() {
    run(async {
        let mut bench = Bench::new();
        bench.script("brief", "for i in 1 2 3 4 5 6 7; do echo line $i; done; exit 7");
        bench.launch(9, "brief");

        let reason = bench.until_exit(9).await;

        assert_eq!(
            reason,
            "exit status 7; last output: line 3 | line 4 | line 5 | line 6 | line 7"
        );
        let log = bench.dir.path().join("logs/mapping.lidar.log");
        assert_eq!(fs::read_to_string(log).unwrap().lines().count(), 7);
    });
}

#[test]
fn an_executable_that_is_nowhere_is_told_with_the_folders() {
    run(async {
        let mut bench = Bench::new();
        for (instance, name) in [(1, "absent"), (2, "../bin/sh")] {
            bench.launch(instance, name);
            let InstanceNews::LaunchFailed { reason } = bench.news(instance).await else {
                panic!("launched")
            };
            assert!(reason.contains(name), "{reason}");
        }
        bench.launch(3, "absent");
        let InstanceNews::LaunchFailed { reason } = bench.news(3).await else { panic!("launched") };
        assert!(reason.contains("/bin,") && reason.contains("[components] path"), "{reason}");
    });
}

#[test]
fn a_process_that_never_greets_is_told_and_can_be_killed_with_its_children() {
    run(async {
        let mut bench = Bench::new();
        let mark = bench.dir.path().join("child");
        let lines = format!("trap '' TERM; sleep 1000 & echo $! > {}; wait", mark.display());
        bench.script("silent", &lines);
        bench.launch(1, "silent");
        assert!(matches!(bench.news(1).await, InstanceNews::Started { .. }));

        let reason = bench.until_hung(1).await;
        assert!(reason.contains("no greeting for 0.6 s"), "{reason}");

        bench.supervisor.command(1, Command::Finish);
        let reason = bench.until_exit(1).await;
        assert!(reason.contains("killed by signal 9"), "{reason}");
        let child = fs::read_to_string(mark).unwrap();
        let stat = format!("/proc/{}/stat", child.trim());
        // Gone, or dead and not yet reaped by whoever inherited it.
        while fs::read_to_string(&stat).is_ok_and(|text| !text.contains(") Z ")) {
            tokio::time::sleep(Duration::from_millis(5)).await;
        }
    });
}

#[test]
fn garbage_of_a_component_closes_its_line_and_nobody_elses() {
    run(async {
        let mut bench = Bench::new();
        bench.launch_component(1, "garbage");
        bench.launch_component(2, "good");
        bench.supervisor.command(2, Command::Activate(token(1)));
        bench.until_state(2, LifecycleState::Active).await;

        bench.supervisor.command(1, Command::Activate(token(1)));
        let reason = bench.until_exit(1).await;

        assert!(reason.starts_with("exit status 3") && reason.contains("sing"), "{reason}");
        assert_eq!(bench.trouble.counters()["component_lines_bad"], 1);
        bench.supervisor.command(2, Command::Finish);
        assert!(bench.until_exit(2).await.starts_with("exit status 0"));
    });
}

#[test]
fn strangers_on_the_socket_get_an_error_and_are_counted() {
    run(async {
        let mut bench = Bench::new();
        bench.script("sleeper", "exec sleep 1000");
        bench.launch(1, "sleeper");
        assert!(matches!(bench.news(1).await, InstanceNews::Started { .. }));
        let socket = bench.dir.path().join("c.sock");
        // The right words from the wrong process.
        let hello = r#"{"type":"hello","v":1,"component":{"system":"mapping","name":"lidar","scope":null},"instance":INSTANCE,"pid":1,"profile":{"name":"x","inputs":[],"outputs":[]},"now":{"state":"created"}}"#;
        let lines = [
            ("GET / HTTP/1.1".to_string(), "line 1"),
            (hello.replace("INSTANCE", "1"), "is not the process of instance 1"),
            (hello.replace("INSTANCE", "77"), "instance 77 of mapping/lidar was not started"),
            (hello.replace("\"v\":1", "\"v\":9").replace("INSTANCE", "1"), "protocol version 9"),
            (
                r#"{"type":"beat","ticks":1,"late":0,"period_worst_ns":0,"execute_worst_ns":0}"#
                    .into(),
                "must be `hello`",
            ),
            ("x".repeat(70_000), "longer than"),
        ];
        for (line, wanted) in &lines {
            let line = format!("{line}\n");
            let socket = socket.clone();
            let answer = tokio::task::spawn_blocking(move || {
                let mut stream = UnixStream::connect(socket).unwrap();
                // A line that is too long is refused before its end.
                let _ = stream.write_all(line.as_bytes());
                let mut answer = String::new();
                let _ = stream.read_to_string(&mut answer);
                answer
            });
            let answer = answer.await.unwrap();
            assert!(answer.contains(wanted), "{answer:?} {wanted}");
        }
        assert_eq!(bench.trouble.counters().values().sum::<u64>(), 6);
        assert_eq!(bench.events.since(0).len(), 2);
        bench.supervisor.command(1, Command::Kill);
        bench.until_exit(1).await;
    });
}

#[test]
fn stopping_ends_all_components_deaf_ones_too() {
    run(async {
        let mut bench = Bench::new();
        bench.launch_component(1, "good");
        bench.launch_component(2, "deaf");
        let mut ready = 0;
        while ready < 2 {
            let Input::Instance { news, .. } = bench.inputs.recv().await.unwrap() else { continue };
            let inactive = LifecycleState::Inactive;
            ready +=
                usize::from(matches!(news, InstanceNews::State { state, .. } if state == inactive));
        }
        let pids: Vec<u32> =
            journal::read(bench.dir.path()).entries.iter().map(|entry| entry.pid).collect();
        assert_eq!(pids.len(), 2);

        bench.supervisor.stop(Whom::All).await;

        for pid in pids {
            assert_eq!(journal::start_time(pid), None);
        }
        assert!(!bench.dir.path().join("c.sock").exists());
    });
}
