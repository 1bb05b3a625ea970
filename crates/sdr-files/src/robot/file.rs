//! robot.toml as it is written.

use std::time::Duration;

use schemars::{Schema, SchemaGenerator, json_schema};
use sdr_core::{
    id::{Name, RobotId},
    report::RolePreference,
    spec::OnAgentDeath,
    units::{Bytes, Permille},
};

use super::{
    config::LogFormat,
    mesh::Unsealed,
    sources::{BatteryEntry, PositionEntry, RssiEntry},
};
use crate::{
    read::{At, Map, Read, Reader, choices, table},
    tree::{Body, Node},
};

table! {
    /// One robot: /etc/sdr/robot.toml, given as `sdr-agent --config robot.toml`.
    pub(crate) struct RobotFile {
        /// Who it is.
        robot: Option<RobotTable>,
        /// What components may use.
        capacity: Option<CapacityTable>,
        /// How it meets the others.
        mesh: At<MeshTable>,
        /// Its radio.
        radio: Option<RadioTable>,
        /// Where figures of the body come from; leave out what the robot lacks.
        sensors: Option<SensorsTable>,
        /// How components run.
        components: Option<ComponentsTable>,
        /// ROS 2.
        ros: Option<RosTable>,
        /// The coordinator role.
        coordinator: Option<CoordinatorTable>,
        /// The agent's API.
        api: Option<ApiTable>,
        /// What is kept on disk.
        storage: Option<StorageTable>,
        /// The agent's own log.
        log: Option<LogTable>,
    }
}

table! {
    /// Who the robot is.
    pub(crate) struct RobotTable {
        /// Its name; default: the host's name. In ROS names `-` becomes `_`.
        name: Option<At<RobotId>>,
        /// Free words that a system may ask for.
        labels: Option<At<Vec<String>>>,
        /// Parts of the body: a list of names, or a table of name = file.
        devices: Option<At<Devices>>,
    }
}

table! {
    /// What components may use.
    pub(crate) struct CapacityTable {
        /// Memory, used by our processes; default: the machine's less the reserve, used by all.
        memory: Option<At<Bytes>>,
        /// CPU, 100% is one core, used by our processes; default: all cores, used by all.
        cpu: Option<At<Permille>>,
        /// Kept for the system itself; default 150MB.
        reserve_memory: Option<At<Bytes>>,
    }
}

table! {
    /// How the robot meets the others.
    pub(crate) struct MeshTable {
        /// Folder with certificate and mesh keys, made by `sdr keys add ROBOT`.
        keys: Option<At<String>>,
        /// Plain datagrams instead: true on loopback, "anywhere" on any network.
        unsealed: Option<At<Unsealed>>,
        /// The fleet's name; default that of the keys, else `fleet`.
        fleet: Option<At<RobotId>>,
        /// UDP address, for datagrams and QUIC; default 0.0.0.0:7600, 127.0.0.1:7600 without keys;
        /// port 0 takes a free one.
        listen: Option<At<String>>,
        /// Where others listen; the rest are learned.
        seeds: Option<At<Vec<At<String>>>>,
        /// Whether to look for others on the local network, by multicast; default true where the
        /// mesh has keys, no seeds, and is not on loopback.
        discovery: Option<bool>,
        /// Where to look; default: all but loopback and docker*.
        interfaces: Option<At<Vec<At<String>>>>,
        /// Time between two rounds of gossip; default 350ms.
        gossip_period: Option<At<Duration>>,
        /// Age of the last news at which a robot counts as gone; default 11.5s.
        gone_after: Option<At<Duration>>,
        /// How long to wait for a peer after the start; default 2s.
        rejoin_wait: Option<At<Duration>>,
        /// From learning a new mesh key to sealing with it; as long again, and older ones
        /// open no more; default 20s.
        key_grace: Option<At<Duration>>,
    }
}

table! {
    /// The radio.
    pub(crate) struct RadioTable {
        /// Its interface; default: the first that the source lists.
        interface: Option<At<String>>,
        /// infrastructure: the level of a pair is the worse of both ends towards their access point.
        mode: Option<At<RadioMode>>,
        /// auto (/proc/net/wireless), or a file of that format.
        rssi: Option<At<RssiEntry>>,
        /// Time between two samples; default 100ms.
        period: Option<At<Duration>>,
    }
}

table! {
    /// Where figures of the body come from.
    pub(crate) struct SensorsTable {
        /// Charge.
        battery: Option<At<BatteryEntry>>,
        /// Where the robot stands, in one frame for all robots.
        position: Option<At<PositionEntry>>,
    }
}

table! {
    /// How components run.
    pub(crate) struct ComponentsTable {
        /// Folders with executables; default: beside the agent.
        path: Option<At<Vec<At<String>>>>,
        /// What becomes of components when the agent dies; default keep.
        on_agent_death: Option<At<OnAgentDeath>>,
        /// Where limits are enforced: auto (default), off, or a folder of cgroup v2.
        cgroup: Option<At<String>>,
    }
    later {
        user: "components run as the agent's user; another user",
        groups: "components run with the agent's groups; other groups",
    }
}

table! {
    /// ROS 2.
    pub(crate) struct RosTable {
        /// DDS domain, 0 to 232; default 0.
        domain_id: Option<At<u16>>,
        /// IPv4 addresses of this robot by which samples cross; default: all it has.
        addresses: Option<At<Vec<At<String>>>>,
    }
    later {
        static_peers: "unicast ROS 2 machines",
        setup: "the environment of foreign ROS 2 nodes",
        isolate: "keeping foreign ROS 2 nodes to their robot",
    }
}

table! {
    /// The coordinator role.
    pub(crate) struct CoordinatorTable {
        /// preferred, able (by fitness, the default) or forbidden.
        preference: Option<At<RolePreference>>,
    }
}

table! {
    /// The agent's API.
    pub(crate) struct ApiTable {
        /// Unix socket; default /run/sdr/agent.sock, or below XDG_RUNTIME_DIR.
        socket: Option<At<String>>,
        /// TCP address for operators of other machines, such as 0.0.0.0:7601; needs [mesh]
        /// keys; default: none.
        listen: Option<At<String>>,
    }
    later {
        prometheus: "metrics for Prometheus",
    }
}

table! {
    /// What is kept on disk.
    pub(crate) struct StorageTable {
        /// Desired state and epochs; default /var/lib/sdr, or below XDG_STATE_HOME.
        state: Option<At<String>>,
        /// Metrics, events and chosen ports as MCAP.
        recordings: Option<RecordingsEntry>,
        /// Output of components.
        logs: Option<LogsTable>,
    }
}

table! {
    /// Metrics, events and chosen ports as MCAP.
    pub(crate) struct RecordingsTable {
        /// Their folder; default: `recordings` below `state`.
        dir: Option<At<String>>,
        /// All of them together, default 2GB; the oldest go first.
        max: Option<At<Bytes>>,
        /// Ports to record, such as `exploration.position.odometry`.
        ports: Option<At<Vec<At<String>>>>,
    }
    later { keep_free: "minding the disk's free space", }
}

table! {
    /// Output of components.
    pub(crate) struct LogsTable {
        /// Their folder; default: `logs` below `state`.
        dir: Option<At<String>>,
        /// All of them together; default 50MB.
        max: Option<At<Bytes>>,
        /// Each of them; default 5MB.
        each: Option<At<Bytes>>,
    }
}

table! {
    /// The agent's own log.
    pub(crate) struct LogTable {
        /// error, warn, info (default), debug, trace; RUST_LOG wins.
        level: Option<At<String>>,
        /// text (default) or json.
        format: Option<At<LogFormat>>,
    }
}

/// Parts of the body: names, or names with files.
#[derive(Clone, Debug)]
pub(crate) enum Devices {
    Names(Vec<At<Name>>),
    Files(Map<String>),
}

impl Read for Devices {
    fn read(node: &Node, reader: &mut Reader) -> Option<Self> {
        match &node.body {
            Body::List(_) => Vec::read(node, reader).map(Self::Names),
            Body::Table(_) => Map::read(node, reader).map(Self::Files),
            Body::Nothing | Body::Bool(_) | Body::Int(_) | Body::Float(_) | Body::Text(_) => {
                reader.wrong(node, "a list such as [\"camera\"], or { camera = \"/dev/video0\" }");
                None
            }
        }
    }

    fn schema(generator: &mut SchemaGenerator) -> Schema {
        json_schema!({
            "anyOf": [Vec::<Name>::schema(generator), Map::<String>::schema(generator)]
        })
    }
}

/// `"off"`, or where and how much.
#[derive(Clone, Debug)]
pub(crate) enum RecordingsEntry {
    Off,
    On(RecordingsTable),
}

impl Read for RecordingsEntry {
    fn read(node: &Node, reader: &mut Reader) -> Option<Self> {
        if matches!(node.body, Body::Table(_)) {
            return RecordingsTable::read(node, reader).map(Self::On);
        }
        reader.choice(node, &["off", "{ dir = \"...\", max = \"2GB\" }"], &[])?;
        Some(Self::Off)
    }

    fn schema(generator: &mut SchemaGenerator) -> Schema {
        json_schema!({ "anyOf": [{ "const": "off" }, RecordingsTable::schema(generator)] })
    }
}

impl schemars::JsonSchema for RecordingsEntry {
    fn inline_schema() -> bool {
        true
    }

    fn schema_name() -> std::borrow::Cow<'static, str> {
        std::borrow::Cow::Borrowed("Recordings")
    }

    fn json_schema(generator: &mut SchemaGenerator) -> Schema {
        Self::schema(generator)
    }
}

/// How robots reach each other.
#[derive(Clone, Copy, Debug)]
pub(crate) struct RadioMode;

impl Read for RadioMode {
    fn read(node: &Node, reader: &mut Reader) -> Option<Self> {
        let later = [("adhoc", "each pair with a level of its own")];
        reader.choice(node, &["infrastructure"], &later).map(|_| Self)
    }

    fn schema(_: &mut SchemaGenerator) -> Schema {
        json_schema!({ "const": "infrastructure" })
    }
}

choices! {
    OnAgentDeath { "keep" => Self::Keep, "stop" => Self::Stop, }
    RolePreference {
        "preferred" => Self::Preferred,
        "able" => Self::Able,
        "forbidden" => Self::Forbidden,
    }
    LogFormat { "text" => Self::Text, "json" => Self::Json, }
}
