//! From robot.toml as written to the checked configuration.

use std::{path::PathBuf, time::Duration};

use sdr_core::{
    id::{Name, NameError, RobotId},
    report::RolePreference,
    spec::{OnAgentDeath, PortRef},
    units::Bytes,
};

use super::{
    config::{
        ApiConfig, CapacityConfig, Cgroup, ComponentsConfig, DeviceConfig, LogConfig, LogFormat,
        LogsConfig, RadioConfig, RecordingsConfig, RobotConfig, SensorsConfig, StorageConfig,
        SystemPort,
    },
    file::{
        CapacityTable, ComponentsTable, Devices, LogTable, RadioMode, RadioTable, RecordingsEntry,
        RobotFile, RobotTable, SensorsTable, StorageTable,
    },
    mesh::{api_listen, bounded, mesh},
    places::Places,
    ros::ros,
    sources::{BatterySource, PositionSource, RssiEntry, RssiSource, SensorEntry},
};
use crate::{
    problem::Mark,
    read::{At, Reader},
};

/// The checked configuration; every problem is told to `reader`.
pub(super) fn checked(
    file: RobotFile,
    places: &Places,
    reader: &mut Reader,
) -> Option<RobotConfig> {
    let (name, labels, devices) = body(file.robot, places, reader);
    let mesh = mesh(file.mesh, places, reader);
    let capacity = capacity(file.capacity, reader);
    let radio = radio(file.radio, places, reader);
    let sensors = file.sensors.map(|table| sensors(table, places, reader)).unwrap_or_default();
    let ros = file.ros.map(|table| ros(table, reader)).unwrap_or_default();
    let preference = file.coordinator.and_then(|table| table.preference);
    let (socket, listen) = file.api.map_or((None, None), |table| (table.socket, table.listen));
    let api = ApiConfig {
        socket: path_or(socket, places, || places.run.join("agent.sock")),
        listen: api_listen(listen, mesh.as_ref(), reader),
    };
    let storage = storage(file.storage, places, reader);
    let log = log(file.log, reader);
    let config = RobotConfig {
        name: name?,
        labels,
        devices,
        capacity,
        mesh: mesh?,
        radio,
        sensors,
        components: components(file.components, places),
        ros,
        coordinator: preference.map_or(RolePreference::Able, |preference| preference.value),
        api,
        storage,
        log,
    };
    reader.is_clean().then_some(config)
}

fn components(table: Option<ComponentsTable>, places: &Places) -> ComponentsConfig {
    let (path, on_agent_death, cgroup) =
        table.map_or((None, None, None), |table| (table.path, table.on_agent_death, table.cgroup));
    let path = path.map(|path| path.value).unwrap_or_default();
    ComponentsConfig {
        path: path.iter().map(|at| places.resolve(&at.value)).collect(),
        on_agent_death: on_agent_death.map_or(OnAgentDeath::Keep, |at| at.value),
        cgroup: match cgroup.as_ref().map(|at| at.value.as_str()) {
            None | Some("auto") => Cgroup::Auto,
            Some("off") => Cgroup::Off,
            Some(folder) => Cgroup::Below(places.resolve(folder)),
        },
    }
}

fn path_or(
    given: Option<At<String>>,
    places: &Places,
    default: impl FnOnce() -> PathBuf,
) -> PathBuf {
    given.map_or_else(default, |path| places.resolve(&path.value))
}

fn body(
    table: Option<RobotTable>,
    places: &Places,
    reader: &mut Reader,
) -> (Option<RobotId>, Vec<String>, Vec<DeviceConfig>) {
    let (name, labels, devices) =
        table.map_or((None, None, None), |table| (table.name, table.labels, table.devices));
    let name = match name {
        Some(name) => Some(name.value),
        None if !reader.is_clean() => None,
        None => RobotId::new(&places.host_name)
            .map_err(|error| {
                let message = format!("the host's name is no robot's name: {error}");
                let help = String::from("give [robot] a `name`");
                reader.problem(Mark::FILE, message, Some(help));
            })
            .ok(),
    };
    let labels = labels.map(|labels| labels.value).unwrap_or_default();
    (name, labels, devices.map(|list| self::devices(list, places, reader)).unwrap_or_default())
}

fn devices(list: At<Devices>, places: &Places, reader: &mut Reader) -> Vec<DeviceConfig> {
    match list.value {
        Devices::Names(names) => {
            names.into_iter().map(|name| DeviceConfig { name: name.value, path: None }).collect()
        }
        Devices::Files(entries) => entries
            .0
            .into_iter()
            .filter_map(|(key, path)| {
                let name = Name::new(&key.value)
                    .map_err(|error| reader.problem(key.mark, error.to_string(), None))
                    .ok()?;
                Some(DeviceConfig { name, path: Some(places.resolve(&path?)) })
            })
            .collect(),
    }
}

fn capacity(table: Option<CapacityTable>, reader: &mut Reader) -> CapacityConfig {
    let (memory, cpu, reserve) =
        table.map_or((None, None, None), |t| (t.memory, t.cpu, t.reserve_memory));
    let mut more_than_none = |mark: Mark, none: bool| {
        if none {
            reader.problem(
                mark,
                "a capacity of nothing",
                Some(String::from("allowed: more than 0")),
            );
        }
    };
    if let Some(memory) = &memory {
        more_than_none(memory.mark, memory.value.0 == 0);
    }
    if let Some(cpu) = &cpu {
        more_than_none(cpu.mark, cpu.value.0 == 0);
    }
    CapacityConfig {
        memory: memory.map(|at| at.value),
        cpu: cpu.map(|at| at.value),
        reserve_memory: reserve.map_or(Bytes::mega(150), |at| at.value),
    }
}

fn radio(table: Option<RadioTable>, places: &Places, reader: &mut Reader) -> RadioConfig {
    let (interface, mode, rssi, period) =
        table.map_or((None, None, None, None), |t| (t.interface, t.mode, t.rssi, t.period));
    match mode.map(|at| at.value) {
        // The only mode so far, and so the default.
        Some(RadioMode) | None => {}
    }
    RadioConfig {
        interface: interface.map(|at| at.value),
        rssi: match rssi.map(|at| at.value) {
            Some(RssiEntry::File(path)) => RssiSource::File(places.resolve(&path)),
            Some(RssiEntry::Auto) | None => RssiSource::Auto,
        },
        period: period.map_or(Duration::from_millis(100), |at| bounded(&at, (10, 10_000), reader)),
    }
}

fn sensors(table: SensorsTable, places: &Places, reader: &mut Reader) -> SensorsConfig {
    let battery = table.battery.and_then(|at| match at.value.0 {
        SensorEntry::PowerSupply(name) => Some(BatterySource::PowerSupply(name)),
        SensorEntry::File(path) => Some(BatterySource::File(places.resolve(&path))),
        SensorEntry::Port(port) => system_port(&port, reader).map(BatterySource::Port),
    });
    let position = table.position.and_then(|at| match at.value.0 {
        SensorEntry::File(path) => Some(PositionSource::File(places.resolve(&path))),
        SensorEntry::Port(port) => system_port(&port, reader).map(PositionSource::Port),
        SensorEntry::PowerSupply(_) => None,
    });
    SensorsConfig { battery, position }
}

/// `exploration.position.odometry`.
fn system_port(at: &At<String>, reader: &mut Reader) -> Option<SystemPort> {
    let words: Vec<&str> = at.value.split('.').collect();
    let [system, component, port] = words.as_slice() else {
        let message = format!("`{}` is no port of a system", at.value);
        let help = String::from("allowed: system.component.port");
        reader.problem(at.mark, message, Some(help));
        return None;
    };
    let made = || -> Result<SystemPort, NameError> {
        let port = PortRef { component: Name::new(component)?, port: Name::new(port)? };
        Ok(SystemPort { system: Name::new(system)?, port })
    };
    made().map_err(|error| reader.problem(at.mark, error.to_string(), None)).ok()
}

fn storage(table: Option<StorageTable>, places: &Places, reader: &mut Reader) -> StorageConfig {
    let (state, recordings, logs) =
        table.map_or((None, None, None), |t| (t.state, t.recordings, t.logs));
    let state = path_or(state, places, || places.state.clone());
    let recordings = match recordings {
        Some(RecordingsEntry::Off) => None,
        Some(RecordingsEntry::On(table)) => Some((table.dir, table.max, table.ports)),
        None => Some((None, None, None)),
    };
    let recordings = recordings.map(|(dir, max, ports)| RecordingsConfig {
        dir: path_or(dir, places, || state.join("recordings")),
        max: max.map_or(Bytes::mega(2000), |at| at.value),
        ports: ports
            .map(|ports| ports.value.iter().filter_map(|at| system_port(at, reader)).collect())
            .unwrap_or_default(),
    });
    let (dir, max, each) = logs.map_or((None, None, None), |t| (t.dir, t.max, t.each));
    let logs = LogsConfig {
        dir: path_or(dir, places, || state.join("logs")),
        max: max.map_or(Bytes::mega(50), |at| at.value),
        each: each.map_or(Bytes::mega(5), |at| at.value),
    };
    StorageConfig { state, recordings, logs }
}

fn log(table: Option<LogTable>, reader: &mut Reader) -> LogConfig {
    const LEVELS: &[&str] = &["error", "warn", "info", "debug", "trace"];
    let (level, format) = table.map_or((None, None), |table| (table.level, table.format));
    if let Some(level) = &level {
        let first = level.value.split([',', '=']).next().unwrap_or_default();
        let plain = !level.value.contains(['=', ',']);
        if plain && !LEVELS.contains(&first) {
            reader.unknown(level.mark, "level", first, LEVELS);
        }
    }
    LogConfig {
        level: level.map_or_else(|| String::from("info"), |level| level.value),
        format: format.map_or(LogFormat::Text, |format| format.value),
    }
}
