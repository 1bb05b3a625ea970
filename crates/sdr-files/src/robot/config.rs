//! robot.toml after all checks.

use std::{
    fmt,
    net::{Ipv4Addr, SocketAddr},
    path::PathBuf,
    time::Duration,
};

use sdr_core::{
    id::{Name, RobotId},
    report::RolePreference,
    spec::{OnAgentDeath, PortRef},
    units::{Bytes, Permille},
};

use super::sources::{BatterySource, PositionSource, RssiSource};

/// One robot, checked: names are names, paths are absolute, addresses are addresses.
#[derive(Clone, Debug, PartialEq)]
pub struct RobotConfig {
    /// Its name.
    pub name: RobotId,
    /// Free words that a system may ask for.
    pub labels: Vec<String>,
    /// Parts of the body.
    pub devices: Vec<DeviceConfig>,
    /// What components may use.
    pub capacity: CapacityConfig,
    /// How it meets the others.
    pub mesh: MeshConfig,
    /// Its radio.
    pub radio: RadioConfig,
    /// Where figures of the body come from.
    pub sensors: SensorsConfig,
    /// How components run.
    pub components: ComponentsConfig,
    /// ROS 2.
    pub ros: RosConfig,
    /// Preference for the coordinator role.
    pub coordinator: RolePreference,
    /// The API.
    pub api: ApiConfig,
    /// What is kept on disk.
    pub storage: StorageConfig,
    /// The agent's own log.
    pub log: LogConfig,
}

/// A part of the body.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct DeviceConfig {
    /// Its name.
    pub name: Name,
    /// Its file; gone from there means lost. `None` when nobody watches it.
    pub path: Option<PathBuf>,
}

/// What components may use.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct CapacityConfig {
    /// Memory; `None` means what the machine has.
    pub memory: Option<Bytes>,
    /// CPU, thousandths of one core; `None` means all cores.
    pub cpu: Option<Permille>,
    /// Kept for the system and never given away; taken from what the machine has when
    /// `memory` is `None`.
    pub reserve_memory: Bytes,
}

/// How the robot meets the others.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct MeshConfig {
    /// Datagrams of other fleets are dropped; `None` takes the fleet of the keys.
    pub fleet: Option<String>,
    /// Who can read and write datagrams.
    pub seal: Seal,
    /// UDP, for datagrams and QUIC; port 0 takes a free one.
    pub listen: SocketAddr,
    /// Where others listen.
    pub seeds: Vec<SocketAddr>,
    /// How to find more of them on the local network; `None` when nobody looks.
    pub discovery: Option<Interfaces>,
    /// Time between two rounds of gossip.
    pub gossip_period: Duration,
    /// Age of the last fresh news at which a robot counts as gone.
    pub gone_after: Duration,
    /// How long to wait for a peer after the start.
    pub rejoin_wait: Duration,
    /// From learning a new mesh key to sealing with it.
    pub key_grace: Duration,
}

/// On which networks others are looked for.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Interfaces {
    /// All but loopback and those of docker.
    Usual,
    /// These.
    Named(Vec<String>),
}

/// Who can read and write datagrams of the mesh.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Seal {
    /// Robots whose folder holds the fleet's mesh key.
    Keys(PathBuf),
    /// Whoever reaches the port: loopback, or asked for in so many words.
    Plain,
}

/// The radio.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct RadioConfig {
    /// Its interface; `None` takes the first that the source lists.
    pub interface: Option<String>,
    /// Where the level comes from.
    pub rssi: RssiSource,
    /// Time between two samples.
    pub period: Duration,
}

/// Where figures of the body come from; `None` means unknown.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct SensorsConfig {
    /// Charge.
    pub battery: Option<BatterySource>,
    /// Where the robot stands.
    pub position: Option<PositionSource>,
}

/// How components run.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct ComponentsConfig {
    /// Folders with executables, in this order; empty means beside the agent.
    pub path: Vec<PathBuf>,
    /// What becomes of components when the agent dies, unless their system says otherwise.
    pub on_agent_death: OnAgentDeath,
    /// Where limits are enforced.
    pub cgroup: Cgroup,
}

/// Where limits of components are enforced.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Cgroup {
    /// Beside the agent's own group, when that was delegated as a subgroup `agent`; else by
    /// rlimits.
    Auto,
    /// Nowhere: by rlimits.
    Off,
    /// Below this folder of the cgroup v2 file system, which the agent's user may write.
    Below(PathBuf),
}

/// ROS 2.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct RosConfig {
    /// DDS domain, 0..=232.
    pub domain_id: u16,
    /// The addresses by which samples cross; empty: all that the robot has.
    pub addresses: Vec<Ipv4Addr>,
}

/// The API.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct ApiConfig {
    /// Unix socket.
    pub socket: PathBuf,
    /// TCP, for operators with certificates; `None` when nobody else is served.
    pub listen: Option<SocketAddr>,
}

/// What is kept on disk.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct StorageConfig {
    /// Folder of deployments, assignments and epochs.
    pub state: PathBuf,
    /// Recordings; `None` when they are off.
    pub recordings: Option<RecordingsConfig>,
    /// Output of components.
    pub logs: LogsConfig,
}

/// Recordings.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct RecordingsConfig {
    /// Their folder.
    pub dir: PathBuf,
    /// All of them together; the oldest go first.
    pub max: Bytes,
    /// Ports whose samples are recorded too.
    pub ports: Vec<SystemPort>,
}

/// A port of a component of some system.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct SystemPort {
    /// The system.
    pub system: Name,
    /// Component and port.
    pub port: PortRef,
}

impl fmt::Display for SystemPort {
    /// `exploration.position.odometry`.
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}.{}", self.system, self.port)
    }
}

/// Output of components.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct LogsConfig {
    /// Their folder.
    pub dir: PathBuf,
    /// All of them together.
    pub max: Bytes,
    /// Each of them.
    pub each: Bytes,
}

/// The agent's own log.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct LogConfig {
    /// As RUST_LOG, which wins: `info`, or `info,sdr_agent=debug`.
    pub level: String,
    /// Its form.
    pub format: LogFormat,
}

/// Form of the log.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum LogFormat {
    /// For people.
    Text,
    /// One JSON object a line.
    Json,
}
