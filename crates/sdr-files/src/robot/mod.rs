//! robot.toml: one robot's body, radio, mesh and places.
//!
//! Every line has a default but `[mesh]`, which must name keys or ask for `unsealed = true`.

mod check;
mod config;
mod file;
mod mesh;
mod places;
mod ros;
mod sources;

use std::path::Path;

pub use config::{
    ApiConfig, CapacityConfig, Cgroup, ComponentsConfig, DeviceConfig, Interfaces, LogConfig,
    LogFormat, LogsConfig, MeshConfig, RadioConfig, RecordingsConfig, RobotConfig, RosConfig, Seal,
    SensorsConfig, StorageConfig, SystemPort,
};
pub use places::Places;
pub use sdr_core::spec::OnAgentDeath;
pub use sources::{BatterySource, PositionSource, RssiSource};

pub(crate) use file::RobotFile;

use crate::{
    problem::{Problems, Source},
    read::{Read, Reader},
    tree::parse_toml,
};

/// Reads and checks robot.toml at `path`.
///
/// Relative paths in it count from its own folder. Missing places are those of this
/// process's user ([`Places::of_this_process`]).
pub fn load_robot(path: &Path) -> Result<RobotConfig, Problems> {
    let source = Source::load(path)?;
    let folder = std::path::absolute(path).ok().and_then(|path| path.parent().map(Path::to_owned));
    let mut places = Places::of_this_process();
    places.folder = folder.unwrap_or_default();
    robot_of(source, &places)
}

/// As [`load_robot`] for text that stands in no file yet; `file` names it in problems.
pub fn parse_robot(file: &str, text: &str, places: &Places) -> Result<RobotConfig, Problems> {
    robot_of(Source::new(file, text), places)
}

fn robot_of(source: Source, places: &Places) -> Result<RobotConfig, Problems> {
    let mut reader = Reader::new(source.clone());
    let config = match parse_toml(&source) {
        Ok(tree) => RobotFile::read(&tree, &mut reader)
            .and_then(|file| check::checked(file, places, &mut reader)),
        Err(problems) => return Err(Problems::of(problems)),
    };
    reader.finish(config)
}

#[cfg(test)]
mod tests;
