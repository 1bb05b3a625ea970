//! From robot.toml to what each driver needs.

use std::collections::{BTreeMap, BTreeSet};
use std::env;
use std::path::PathBuf;

use rand::TryRngCore as _;
use rand::rngs::OsRng;
use sdr_component::protocol::SharedMemory;
use sdr_core::{
    blob::PART_BYTES_MAX, brain::BrainConfig, order::hash64, record::RECORD_BYTES_MAX,
    report::RobotFacts, units::Bytes,
};
use sdr_files::RobotConfig;
use sdr_files::robot::{BatterySource, DeviceConfig, PositionSource, RssiSource, Seal};

use crate::installed::{self, Device};
use crate::metrics::{MetricsConfig, Radio, Sensors, Source, host};
use crate::supervisor::{LogFiles, Patience, SupervisorConfig};

/// Where Linux shows wireless interfaces.
const WIRELESS: &str = "/proc/net/wireless";
/// Where Linux shows batteries.
const POWER_SUPPLY: &str = "/sys/class/power_supply";

/// Folders with executables; beside the agent when robot.toml names none.
pub(crate) fn component_path(config: &RobotConfig) -> Vec<PathBuf> {
    if !config.components.path.is_empty() {
        return config.components.path.clone();
    }
    let beside = env::current_exe().ok().and_then(|agent| agent.parent().map(PathBuf::from));
    beside.into_iter().collect()
}

/// Names of this robot's shared memory: no two agents of a machine share them.
pub(crate) fn shared_memory(config: &RobotConfig) -> SharedMemory {
    let name = format!("{} {}", config.name, config.api.socket.display());
    let hash = format!("{:016x}", hash64(name.as_bytes()));
    let short = &hash[8..];
    SharedMemory { prefix: format!("s{short}_"), root: format!("/dev/shm/sdr/{short}/").into() }
}

/// What components may use in all, as robot.toml or the machine says.
pub(crate) fn memory_capacity(config: &RobotConfig) -> Bytes {
    let of_machine = || host::memory().unwrap_or_default().less(config.capacity.reserve_memory);
    config.capacity.memory.unwrap_or_else(of_machine)
}

/// Parts of the body; those with a file are watched.
pub(crate) fn devices(config: &RobotConfig) -> Vec<Device> {
    let device =
        |device: &DeviceConfig| Device { name: device.name.clone(), file: device.path.clone() };
    config.devices.iter().map(device).collect()
}

/// The fleet's name; `of_keys` is the one that keys name.
pub(crate) fn fleet(config: &RobotConfig, of_keys: Option<&str>) -> String {
    of_keys.or(config.mesh.fleet.as_deref()).unwrap_or("fleet").into()
}

/// The brain's, but for where the mesh listens; `fleet` is the one that keys name.
pub(crate) fn brain(config: &RobotConfig, fleet: Option<&str>) -> BrainConfig {
    let facts = RobotFacts {
        memory_capacity: memory_capacity(config),
        cpu_capacity: config.capacity.cpu.unwrap_or_else(host::cpu),
        labels: config.labels.clone(),
        devices: installed::present(&devices(config)),
        launchables: installed::launchables(&component_path(config)),
        role: config.coordinator,
        api: config.api.socket.display().to_string(),
        version: env!("CARGO_PKG_VERSION").into(),
    };
    BrainConfig {
        fleet: self::fleet(config, fleet),
        seeds: config.mesh.seeds.clone(),
        seed: OsRng.try_next_u64().expect("the kernel always has randomness after boot"),
        gossip_period: config.mesh.gossip_period,
        gone_after: config.mesh.gone_after,
        rejoin_wait: config.mesh.rejoin_wait,
        part_bytes_max: match config.mesh.seal {
            Seal::Keys(_) => PART_BYTES_MAX,
            // blobs travel over sealed streams alone
            Seal::Plain => RECORD_BYTES_MAX,
        },
        ..BrainConfig::new(config.name.clone(), facts)
    }
}

/// The sampler's.
pub(crate) fn metrics(config: &RobotConfig) -> MetricsConfig {
    let file = match &config.radio.rssi {
        RssiSource::Auto => WIRELESS.into(),
        RssiSource::File(path) => path.clone(),
    };
    let battery = config.sensors.battery.as_ref().map(|source| match source {
        BatterySource::PowerSupply(name) => {
            Source::File([POWER_SUPPLY, name, "capacity"].iter().collect())
        }
        BatterySource::File(path) => Source::File(path.clone()),
        BatterySource::Port(port) => Source::of_port(port.to_string()),
    });
    let position = config.sensors.position.as_ref().map(|source| match source {
        PositionSource::File(path) => Source::File(path.clone()),
        PositionSource::Port(port) => Source::of_port(port.to_string()),
    });
    MetricsConfig {
        period: config.radio.period,
        memory_capacity: memory_capacity(config),
        memory_reserve: config.capacity.memory.is_none().then_some(config.capacity.reserve_memory),
        all_cpu: config.capacity.cpu.is_none(),
        radio: Some(Radio { file, interface: config.radio.interface.clone() }),
        sensors: Sensors { battery, position },
    }
}

/// Ports whose samples are recorded.
pub(crate) fn recorded_ports(config: &RobotConfig) -> BTreeSet<String> {
    let ports = config.storage.recordings.iter().flat_map(|wanted| &wanted.ports);
    ports.map(ToString::to_string).collect()
}

/// The supervisor's.
pub(crate) fn supervisor(config: &RobotConfig) -> SupervisorConfig {
    let devices: BTreeMap<String, String> = config
        .devices
        .iter()
        .filter_map(|device| {
            let path = device.path.as_ref()?;
            Some((device.name.to_string(), path.display().to_string()))
        })
        .collect();
    SupervisorConfig {
        path: component_path(config),
        socket: config.api.socket.with_extension("components.sock"),
        state: config.storage.state.clone(),
        logs: LogFiles {
            dir: config.storage.logs.dir.clone(),
            each_bytes_max: config.storage.logs.each.0,
            bytes_max: config.storage.logs.max.0,
        },
        on_agent_death: config.components.on_agent_death,
        devices,
        memory: shared_memory(config),
        cgroup: config.components.cgroup.clone(),
        patience: Patience::default(),
    }
}
