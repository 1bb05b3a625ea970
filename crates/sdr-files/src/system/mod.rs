//! A system: components, connections, policies.

mod check;
mod circle;
mod connections;
mod file;
mod limits;
mod link;
mod order;
mod policies;

use std::path::{Path, PathBuf};

use sdr_core::spec::SystemSpec;

pub(crate) use file::SystemFile;
pub use link::link_profiles;

use crate::{
    policy::Finder,
    problem::{Mark, Problems, Source},
    read::{Read, Reader},
    tree::parse_yaml,
};

/// A system that was read, with the places of its parts for later problems.
#[derive(Clone, Debug)]
pub struct LoadedSystem {
    /// What should run. Message types of connections are empty until [`link_profiles`].
    pub spec: SystemSpec,
    pub(crate) places: SystemPlaces,
}

/// Where the parts of a system stand in its file.
#[derive(Clone, Debug)]
pub(crate) struct SystemPlaces {
    pub(crate) source: Source,
    /// By the index of the component.
    pub(crate) components: Vec<ComponentPlaces>,
    /// By the index of the connection: output, input.
    pub(crate) connections: Vec<(Mark, Mark)>,
}

/// Where the parts of a component stand.
#[derive(Clone, Debug)]
pub(crate) struct ComponentPlaces {
    pub(crate) run: Mark,
    /// Names and values of parameters.
    pub(crate) parameters: Vec<(Mark, Mark)>,
}

/// Reads and checks the system at `path`, with its policies.
pub fn load_system(path: &Path) -> Result<LoadedSystem, Problems> {
    let folder = path.parent().map(PathBuf::from).unwrap_or_default();
    system_of(Source::load(path)?, &folder)
}

/// As [`load_system`] for a text; `file` names it in problems, policies are looked up from
/// `folder`.
pub fn parse_system(file: &str, text: &str, folder: &Path) -> Result<LoadedSystem, Problems> {
    system_of(Source::new(file, text), folder)
}

fn system_of(source: Source, folder: &Path) -> Result<LoadedSystem, Problems> {
    let mut reader = Reader::new(source.clone());
    let tree = parse_yaml(&source).map_err(Problems::of)?;
    let system = SystemFile::read(&tree, &mut reader)
        .and_then(|file| check::checked(file, source, &Finder::from(folder), &mut reader));
    reader.finish(system)
}

#[cfg(test)]
mod tests;
