//! Which kind of file something is, for `sdr validate FILE`.

use std::path::Path;

use crate::{
    LoadedSystem, RobotConfig, Scenario, load_allocation, load_recovery, load_robot, load_role,
    load_scenario, load_system,
    problem::{Mark, Problems, Source},
    read::Reader,
    tree::{Body, parse_yaml},
};

/// The kinds of files people write.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum FileKind {
    /// robot.toml.
    Robot,
    /// A system.
    System,
    /// An allocation policy.
    Allocation,
    /// A recovery policy.
    Recovery,
    /// A policy of the coordinator role.
    Role,
    /// A scenario of the lab.
    Scenario,
}

impl FileKind {
    /// The kind in words.
    pub fn word(self) -> &'static str {
        match self {
            Self::Robot => "robot",
            Self::System => "system",
            Self::Allocation => "allocation policy",
            Self::Recovery => "recovery policy",
            Self::Role => "role policy",
            Self::Scenario => "scenario",
        }
    }
}

/// A checked file of any kind.
#[derive(Clone, Debug)]
pub enum LoadedFile {
    /// robot.toml.
    Robot(Box<RobotConfig>),
    /// A system.
    System(Box<LoadedSystem>),
    /// An allocation policy.
    Allocation(Box<sdr_alloc::Policy>),
    /// A recovery policy.
    Recovery(sdr_recovery::Policy),
    /// A policy of the coordinator role.
    Role(Box<sdr_core::fitness::RolePolicy>),
    /// A scenario of the lab.
    Scenario(Box<Scenario>),
}

impl LoadedFile {
    /// Its kind.
    pub fn kind(&self) -> FileKind {
        match self {
            Self::Robot(_) => FileKind::Robot,
            Self::System(_) => FileKind::System,
            Self::Allocation(_) => FileKind::Allocation,
            Self::Recovery(_) => FileKind::Recovery,
            Self::Role(_) => FileKind::Role,
            Self::Scenario(_) => FileKind::Scenario,
        }
    }
}

/// The kind of the file at `path`: `.toml` is a robot; YAML says it by its keys.
pub fn detect(path: &Path) -> Result<FileKind, Problems> {
    if path.extension().is_some_and(|extension| extension == "toml") {
        return Ok(FileKind::Robot);
    }
    let source = Source::load(path)?;
    let tree = parse_yaml(&source).map_err(Problems::of)?;
    let has = |word: &str| match &tree.body {
        Body::Table(entries) => entries.iter().any(|(key, _)| key.word == word),
        Body::Nothing
        | Body::Bool(_)
        | Body::Int(_)
        | Body::Float(_)
        | Body::Text(_)
        | Body::List(_) => false,
    };
    if has("scenario") || has("timeline") {
        return Ok(FileKind::Scenario);
    }
    // A system names both policies too, so its own keys come first.
    if has("system") || has("components") {
        return Ok(FileKind::System);
    }
    if has("recovery") || has("ladders") || has("rules") {
        return Ok(FileKind::Recovery);
    }
    if has("allocation") || has("strategy") {
        return Ok(FileKind::Allocation);
    }
    if has("role") || has("weights") || has("bars") {
        return Ok(FileKind::Role);
    }
    let mut reader = Reader::new(source);
    let help = "allowed: a file with the key `system`, `allocation`, `recovery`, `role` or `scenario`, or robot.toml";
    let start = Mark { line: 1, column: 1, width: 1 };
    reader.problem(start, "nothing says which kind of file this is", Some(help.to_owned()));
    reader.finish(None)
}

/// Reads and checks the file at `path`, of whatever kind it is.
pub fn load_any(path: &Path) -> Result<LoadedFile, Problems> {
    match detect(path)? {
        FileKind::Robot => load_robot(path).map(|robot| LoadedFile::Robot(Box::new(robot))),
        FileKind::System => load_system(path).map(|system| LoadedFile::System(Box::new(system))),
        FileKind::Allocation => {
            load_allocation(path).map(|policy| LoadedFile::Allocation(Box::new(policy)))
        }
        FileKind::Recovery => load_recovery(path).map(LoadedFile::Recovery),
        FileKind::Role => load_role(path).map(|policy| LoadedFile::Role(Box::new(policy))),
        FileKind::Scenario => {
            load_scenario(path).map(|scenario| LoadedFile::Scenario(Box::new(scenario)))
        }
    }
}
