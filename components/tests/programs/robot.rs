//! One robot with a world around it and an agent as small as can be for all five programs.

use std::collections::BTreeMap;
use std::io::{Read, Write};
use std::os::unix::net::{UnixListener, UnixStream};
use std::path::{Path, PathBuf};
use std::process::{Child, Command};
use std::time::Duration;

use sdr_component::protocol::{
    Configure, ENV_COMPONENT, ENV_INSTANCE, ENV_ORPHAN_MS, ENV_SOCKET, ExecutionSetup,
    FromComponent, LineBuffer, Order, PROTOCOL_VERSION, SharedMemory, StateReport, ToComponent,
    encode_line,
};
use sdr_core::{
    effect::InputWiring,
    id::{ComponentKey, Name, RobotId},
    lifecycle::LifecycleState,
    order::{Epoch, Token},
    spec::{Qos, Value},
};
use sdr_lab::{World, WorldConfig, WorldHandle};

/// Longest wait for anything; only a hang reaches it.
const PATIENCE: Duration = Duration::from_secs(60);

const IMAGE: &str = "sensor_msgs/msg/Image";
const ODOMETRY: &str = "nav_msgs/msg/Odometry";

/// From, to, type: the connections of the paper's Fig. 3, by their index.
const CONNECTIONS: [(&str, &str, &str); 5] = [
    ("fisheye.image", "anomaly.image", IMAGE),
    ("anomaly.danger", "controller.danger", "std_msgs/msg/Bool"),
    ("camera.image", "position.image", IMAGE),
    ("position.odometry", "controller.odometry", ODOMETRY),
    ("controller.wheels", "position.wheels", ODOMETRY),
];

pub(crate) fn executable(name: &str) -> &'static str {
    match name {
        "fisheye" => env!("CARGO_BIN_EXE_fisheye"),
        "anomaly" => env!("CARGO_BIN_EXE_anomaly"),
        "camera" => env!("CARGO_BIN_EXE_camera"),
        "controller" => env!("CARGO_BIN_EXE_controller"),
        "position" => env!("CARGO_BIN_EXE_position"),
        other => panic!("no program {other}"),
    }
}

fn key(name: &str) -> ComponentKey {
    ComponentKey::new(&Name::new("exploration").unwrap(), &Name::new(name).unwrap())
}

/// The robot; everything is gone afterwards.
pub(crate) struct Robot {
    pub(crate) world: WorldHandle,
    memory: SharedMemory,
    folder: tempfile::TempDir,
}

impl Robot {
    pub(crate) fn new() -> Self {
        let folder = tempfile::tempdir_in("/dev/shm").unwrap();
        let config = WorldConfig::convoy(&folder.path().join("w"), "robot-1", &[], 1);
        let word = folder.path().file_name().unwrap().to_str().unwrap().replace(".tmp", "");
        let memory = SharedMemory { prefix: format!("c{word}_"), root: folder.path().join("m") };
        Self { world: World::start(config).unwrap(), memory, folder }
    }

    /// Starts a program and brings it to Inactive, or to Error.
    pub(crate) fn start(&self, name: &str, parameters: &[(&str, Value)]) -> (Program, StateReport) {
        let socket = self.folder.path().join(name);
        let listener = UnixListener::bind(&socket).unwrap();
        let child = Command::new(executable(name))
            .env(ENV_SOCKET, &socket)
            .env(ENV_COMPONENT, key(name).to_string())
            .env(ENV_INSTANCE, "1")
            .env(ENV_ORPHAN_MS, "0")
            .spawn()
            .unwrap();
        let (stream, _) = listener.accept().unwrap();
        stream.set_read_timeout(Some(PATIENCE)).unwrap();
        let mut program = Program { child, stream, buffer: LineBuffer::default() };
        assert!(matches!(program.next(), FromComponent::Hello(_)));
        let configure = self.configure(name, parameters);
        program.say(&ToComponent::Configure(Box::new(configure)));
        let state = program.until(|word| match word {
            FromComponent::State(report) => Some(report),
            _ => None,
        });
        (program, state)
    }

    fn configure(&self, name: &str, parameters: &[(&str, Value)]) -> Configure {
        let paths = &self.world.paths()[0];
        let place = |path: &Path| path.to_str().unwrap().to_owned();
        let devices =
            [("fisheye", &paths.fisheye), ("camera", &paths.camera), ("wheels", &paths.wheels)];
        let wired = (0..).zip(CONNECTIONS).filter_map(|(connection, (from, to, message_type))| {
            let port = to.strip_prefix(name)?.strip_prefix('.')?;
            Some(InputWiring {
                port: Name::new(port).unwrap(),
                connection,
                path: format!("exploration/{}", from.replace('.', "/")),
                message_type: message_type.to_owned(),
                qos: Qos::default(),
            })
        });
        let rate = if matches!(name, "controller" | "position") { 50 } else { 15 };
        Configure {
            v: PROTOCOL_VERSION,
            component: key(name),
            parameters: parameters
                .iter()
                .map(|(name, value)| ((*name).to_owned(), value.clone()))
                .collect(),
            devices: devices.map(|(name, path)| (name.to_owned(), place(path))).into(),
            inputs: wired.collect(),
            output_depth: 8,
            memory: self.memory.clone(),
            execution: ExecutionSetup::Periodic { period_us: 1_000_000 / rate },
        }
    }

    pub(crate) fn folder(&self) -> PathBuf {
        self.folder.path().to_owned()
    }
}

impl Drop for Robot {
    fn drop(&mut self) {
        for entry in std::fs::read_dir("/dev/shm").unwrap().flatten() {
            if entry.file_name().to_string_lossy().starts_with(&self.memory.prefix) {
                let _ = std::fs::remove_file(entry.path());
            }
        }
    }
}

/// A started program; killed when dropped.
pub(crate) struct Program {
    child: Child,
    stream: UnixStream,
    buffer: LineBuffer,
}

impl Program {
    pub(crate) fn activate(&mut self) {
        let epoch = Epoch::first(&RobotId::new("robot-1").unwrap());
        self.say(&ToComponent::Command(Order::Activate { token: Token { epoch, run: 1 } }));
        self.until_state(LifecycleState::Active);
    }

    pub(crate) fn order(&mut self, order: Order) {
        self.say(&ToComponent::Command(order));
    }

    pub(crate) fn until_state(&mut self, state: LifecycleState) -> StateReport {
        self.until(|word| match word {
            FromComponent::State(report) if report.state == state => Some(report),
            _ => None,
        })
    }

    /// Reads until each input accepted that many samples; by connection, how many.
    pub(crate) fn until_accepted(&mut self, samples_min: u64) -> BTreeMap<u16, u64> {
        self.until(|word| match word {
            FromComponent::Counters(counters) => {
                let accepted: BTreeMap<u16, u64> = counters
                    .inputs
                    .iter()
                    .map(|input| (input.connection, input.accepted))
                    .collect();
                accepted.values().all(|count| *count >= samples_min).then_some(accepted)
            }
            _ => None,
        })
    }

    pub(crate) fn until<T>(&mut self, mut wanted: impl FnMut(FromComponent) -> Option<T>) -> T {
        loop {
            if let Some(found) = wanted(self.next()) {
                return found;
            }
        }
    }

    pub(crate) fn has_ended_well(mut self) -> bool {
        self.child.wait().unwrap().success()
    }

    fn say(&mut self, message: &ToComponent) {
        self.stream.write_all(&encode_line(message).unwrap()).unwrap();
    }

    fn next(&mut self) -> FromComponent {
        let mut chunk = [0; 4096];
        loop {
            if let Some(word) = self.buffer.next_message().unwrap() {
                return word;
            }
            let count = self.stream.read(&mut chunk).unwrap();
            assert!(count > 0, "the program hung up");
            self.buffer.push(&chunk[..count]);
        }
    }
}

impl Drop for Program {
    fn drop(&mut self) {
        let _ = self.child.kill();
        let _ = self.child.wait();
    }
}
