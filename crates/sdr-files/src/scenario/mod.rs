//! A scenario of the lab: robots, a timeline of what happens, and what must come of it.

mod check;
mod expect;
mod file;
mod steps;
mod types;
mod words;

use std::path::{Path, PathBuf};

pub use types::{
    Action, Blow, BurstSettings, Choice, Cut, EventWanted, Expectation, LinkSettings, Place,
    RobotSetup, Scenario, Step, Target, Wanted, When,
};

pub(crate) use file::ScenarioFile;

use crate::{
    problem::{Problems, Source},
    read::{Read, Reader},
    tree::parse_yaml,
};

/// Reads and checks the scenario at `path`; relative paths in it count from its folder.
pub fn load_scenario(path: &Path) -> Result<Scenario, Problems> {
    let folder = path.parent().map(PathBuf::from).unwrap_or_default();
    scenario_of(Source::load(path)?, &folder)
}

/// As [`load_scenario`] for a text; `file` names it in problems.
pub fn parse_scenario(file: &str, text: &str, folder: &Path) -> Result<Scenario, Problems> {
    scenario_of(Source::new(file, text), folder)
}

fn scenario_of(source: Source, folder: &Path) -> Result<Scenario, Problems> {
    let mut reader = Reader::new(source.clone());
    let tree = parse_yaml(&source).map_err(Problems::of)?;
    let scenario = ScenarioFile::read(&tree, &mut reader)
        .and_then(|file| check::checked(file, folder, &mut reader));
    reader.finish(scenario)
}
