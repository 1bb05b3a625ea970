//! An agent as small as can be: one socket, one component's process.

use std::collections::BTreeMap;
use std::io::{Read, Write};
use std::os::unix::net::{UnixListener, UnixStream};
use std::path::PathBuf;
use std::process::{Child, Command, ExitStatus};
use std::time::Duration;

use sdr_component::protocol::{
    Configure, ENV_COMPONENT, ENV_INSTANCE, ENV_LEASE_MS, ENV_ORPHAN_MS, ENV_SOCKET,
    ExecutionSetup, FromComponent, Hello, LineBuffer, Order, PROTOCOL_VERSION, SharedMemory,
    StateReport, ToComponent, encode_line,
};
use sdr_core::{
    effect::InputWiring,
    id::{ComponentKey, Name, RobotId},
    lifecycle::LifecycleState,
    order::{Epoch, Token},
    spec::{Qos, Value},
};

/// Longest wait for anything; only a hang reaches it.
const PATIENCE: Duration = Duration::from_secs(30);

pub(crate) fn key() -> ComponentKey {
    ComponentKey::new(&Name::new("test").unwrap(), &Name::new("doubler").unwrap())
}

pub(crate) fn token(number: u64, run: u32) -> Token {
    Token { epoch: Epoch { number, minted_by: RobotId::new("robot-1").unwrap() }, run }
}

/// One robot: a folder, a socket, a place in shared memory.
pub(crate) struct Agent {
    folder: tempfile::TempDir,
    listener: UnixListener,
    pub(crate) memory: SharedMemory,
    /// How long its components may act without it.
    pub(crate) lease: Option<Duration>,
}

impl Agent {
    pub(crate) fn new() -> Self {
        let folder = tempfile::tempdir_in("/dev/shm").unwrap();
        let word = folder.path().file_name().unwrap().to_str().unwrap().replace(".tmp", "");
        let listener = UnixListener::bind(folder.path().join("s")).unwrap();
        let memory = SharedMemory { prefix: format!("p{word}_"), root: folder.path().join("m") };
        Self { folder, listener, memory, lease: None }
    }

    fn socket(&self) -> PathBuf {
        self.folder.path().join("s")
    }

    /// Starts the component that this very test executable holds.
    pub(crate) fn start(&self, orphan_ms: Option<u64>) -> Process {
        let mut command = Command::new(std::env::current_exe().unwrap());
        command
            .args(["--exact", "the_component_itself", "--nocapture", "--test-threads=1"])
            .env(ENV_SOCKET, self.socket())
            .env(ENV_COMPONENT, key().to_string())
            .env(ENV_INSTANCE, "7");
        if let Some(ms) = orphan_ms {
            command.env(ENV_ORPHAN_MS, ms.to_string());
        }
        if let Some(lease) = self.lease {
            command.env(ENV_LEASE_MS, lease.as_millis().to_string());
        }
        Process(command.spawn().unwrap())
    }

    /// Nobody listens for that long; then another agent does.
    pub(crate) fn be_away(&mut self, time: Duration) {
        std::fs::remove_file(self.socket()).unwrap();
        // Closes the old one, too: it would still take connections.
        self.listener = UnixListener::bind(self.folder.path().join("elsewhere")).unwrap();
        std::fs::remove_file(self.folder.path().join("elsewhere")).unwrap();
        std::thread::sleep(time);
        self.listener = UnixListener::bind(self.socket()).unwrap();
    }

    /// The next connection, and its greeting.
    pub(crate) fn greet(&self) -> (Line, Hello) {
        let (stream, _) = self.listener.accept().unwrap();
        stream.set_read_timeout(Some(PATIENCE)).unwrap();
        let mut line = Line { stream, buffer: LineBuffer::default() };
        match line.next() {
            FromComponent::Hello(hello) => (line, *hello),
            other => panic!("no greeting: {other:?}"),
        }
    }

    /// Starts a component and brings it to Inactive.
    pub(crate) fn prepare(
        &self,
        orphan_ms: Option<u64>,
        execution: ExecutionSetup,
    ) -> (Process, Line) {
        let process = self.start(orphan_ms);
        let (mut line, _) = self.greet();
        line.say(&ToComponent::Configure(Box::new(self.configure(execution))));
        line.until_state(LifecycleState::Inactive);
        (process, line)
    }

    pub(crate) fn configure(&self, execution: ExecutionSetup) -> Configure {
        Configure {
            v: PROTOCOL_VERSION,
            component: key(),
            parameters: BTreeMap::from([
                (String::from("factor"), Value::Int(2)),
                (String::from("ballast_bytes"), Value::Int(1 << 20)),
            ]),
            devices: BTreeMap::new(),
            inputs: vec![InputWiring {
                port: Name::new("number").unwrap(),
                connection: 3,
                path: String::from("test/source/number"),
                message_type: String::from("std_msgs/msg/Int32"),
                qos: Qos::default(),
            }],
            output_depth: 8,
            memory: self.memory.clone(),
            execution,
        }
    }
}

impl Drop for Agent {
    fn drop(&mut self) {
        for entry in std::fs::read_dir("/dev/shm").unwrap().flatten() {
            if entry.file_name().to_string_lossy().starts_with(&self.memory.prefix) {
                let _ = std::fs::remove_file(entry.path());
            }
        }
    }
}

/// A started component; killed when dropped.
pub(crate) struct Process(Child);

impl Process {
    pub(crate) fn wait(mut self) -> ExitStatus {
        self.0.wait().unwrap()
    }

    pub(crate) fn id(&self) -> u32 {
        self.0.id()
    }
}

impl Drop for Process {
    fn drop(&mut self) {
        let _ = self.0.kill();
        let _ = self.0.wait();
    }
}

/// A connection to a component.
pub(crate) struct Line {
    stream: UnixStream,
    buffer: LineBuffer,
}

impl Line {
    pub(crate) fn say(&mut self, message: &ToComponent) {
        self.say_bytes(&encode_line(message).unwrap());
    }

    pub(crate) fn order(&mut self, order: Order) {
        self.say(&ToComponent::Command(order));
    }

    pub(crate) fn say_bytes(&mut self, bytes: &[u8]) {
        self.stream.write_all(bytes).unwrap();
    }

    /// The next word; panics when the component hung up.
    pub(crate) fn next(&mut self) -> FromComponent {
        self.try_next().expect("the component hung up")
    }

    /// The next word, or `None` when the component hung up.
    pub(crate) fn try_next(&mut self) -> Option<FromComponent> {
        let mut chunk = [0; 4096];
        loop {
            if let Some(word) = self.buffer.next_message().unwrap() {
                return Some(word);
            }
            match self.stream.read(&mut chunk) {
                Ok(0) | Err(_) => return None,
                Ok(count) => self.buffer.push(&chunk[..count]),
            }
        }
    }

    /// Reads until a word is what is wanted.
    pub(crate) fn until<T>(&mut self, mut wanted: impl FnMut(FromComponent) -> Option<T>) -> T {
        loop {
            if let Some(found) = wanted(self.next()) {
                return found;
            }
        }
    }

    pub(crate) fn until_state(&mut self, state: LifecycleState) -> StateReport {
        self.until(|word| match word {
            FromComponent::State(report) if report.state == state => Some(report),
            _ => None,
        })
    }

    pub(crate) fn until_error(&mut self) -> String {
        self.until(|word| match word {
            FromComponent::Error(error) => Some(error.message),
            _ => None,
        })
    }
}
