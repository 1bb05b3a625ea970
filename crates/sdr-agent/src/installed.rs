//! What this robot can launch, and which of its devices are there, looked at again while it
//! runs.

use std::fs;
use std::path::PathBuf;
use std::sync::Arc;
use std::time::{Duration, SystemTime};

use sdr_core::{id::Name, input::Input, report::RobotFacts, spec::launch_hash};
use tokio::sync::{Mutex, mpsc};

use crate::supervisor::executables;

/// Time between two looks at devices.
const DEVICES_PERIOD: Duration = Duration::from_millis(500);
/// Every so many of them the folders are looked at.
const FOLDERS_EVERY: u32 = 10;
/// Every so many looks at folders all files are read, changed folders or not: a file that becomes
/// executable leaves no trace in its folder.
const THOROUGH_EVERY: u32 = 12;
/// A folder may change again within the same tick of its clock, and a file is often made
/// executable a moment after it was written: a folder that changed just now is read again.
const SETTLED_AFTER: Duration = Duration::from_secs(10);

/// How far a look goes.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Look {
    /// Only at devices.
    Devices,
    /// Also at folders that changed.
    Changed,
    /// Also at all files.
    Thorough,
}

/// Keeps the brain's facts true to the folders; cheap to clone.
#[derive(Clone, Debug)]
pub(crate) struct Installed {
    folders: Arc<[PathBuf]>,
    devices: Arc<[Device]>,
    inputs: mpsc::Sender<Input>,
    told: Arc<Mutex<Told>>,
}

/// A part of the body, and the file that is there when it is.
#[derive(Clone, Debug)]
pub(crate) struct Device {
    pub(crate) name: Name,
    /// `None`: nobody can tell, so it is there.
    pub(crate) file: Option<PathBuf>,
}

/// The names of those that are there.
pub(crate) fn present(devices: &[Device]) -> Vec<Name> {
    let is_there = |device: &&Device| device.file.as_ref().is_none_or(|file| file.exists());
    devices.iter().filter(is_there).map(|device| device.name.clone()).collect()
}

/// What the brain was told last, and what the folders looked like then.
#[derive(Debug)]
struct Told {
    facts: RobotFacts,
    modified: Vec<Option<SystemTime>>,
}

/// Hashes of all that can be launched from `folders`, sorted.
pub(crate) fn launchables(folders: &[PathBuf]) -> Vec<u32> {
    let mut hashes: Vec<u32> = executables(folders).iter().map(|name| launch_hash(name)).collect();
    hashes.sort_unstable();
    hashes
}

impl Installed {
    /// For a brain that knows `facts`; changes go to `inputs`.
    pub(crate) fn new(
        (folders, devices): (Vec<PathBuf>, Vec<Device>),
        facts: RobotFacts,
        inputs: mpsc::Sender<Input>,
    ) -> Self {
        // No folder was seen at any time yet, so the first look reads all.
        let told = Told { facts, modified: Vec::new() };
        Self {
            folders: folders.into(),
            devices: devices.into(),
            inputs,
            told: Arc::new(Mutex::new(told)),
        }
    }

    /// Looks again and again until the loop ends. Call within a `LocalSet`.
    pub(crate) fn watch(self) {
        tokio::task::spawn_local(async move {
            let mut looks = 0_u32;
            loop {
                tokio::time::sleep(DEVICES_PERIOD).await;
                looks = looks.wrapping_add(1);
                let look = match looks {
                    _ if looks.is_multiple_of(FOLDERS_EVERY * THOROUGH_EVERY) => Look::Thorough,
                    _ if looks.is_multiple_of(FOLDERS_EVERY) => Look::Changed,
                    _ if self.devices.iter().any(|device| device.file.is_some()) => Look::Devices,
                    _ => continue,
                };
                if self.refresh(look).await.is_err() {
                    return;
                }
            }
        });
    }

    /// Tells the brain what changed, before anything that is sent after this returned. An
    /// error means that the loop has ended.
    pub(crate) async fn refresh(&self, look: Look) -> Result<(), LoopEnded> {
        // Held to the end: who comes second must not overtake what the first one found.
        let mut told = self.told.lock().await;
        let (folders, devices) = (Arc::clone(&self.folders), Arc::clone(&self.devices));
        let before = told.modified.clone();
        let looked = tokio::task::spawn_blocking(move || {
            let present = present(&devices);
            if look == Look::Devices {
                return (before, None, present);
            }
            let modified: Vec<_> = folders.iter().map(modified_at).collect();
            let same = look == Look::Changed && modified == before;
            let found = (!same || modified.iter().any(is_fresh)).then(|| launchables(&folders));
            (modified, found, present)
        });
        // It only fails when the runtime goes down.
        let (modified, found, devices) = looked.await.map_err(|_| LoopEnded)?;
        let mut facts = RobotFacts { devices, ..told.facts.clone() };
        if let Some(found) = found.filter(|found| *found != told.facts.launchables) {
            let (before, now) = (told.facts.launchables.len(), found.len());
            tracing::info!(event = "executables-changed", before, now);
            facts.launchables = found;
        }
        if facts != told.facts {
            let input = Input::Facts(Box::new(facts.clone()));
            self.inputs.send(input).await.map_err(|_| LoopEnded)?;
            told.facts = facts;
        }
        told.modified = modified;
        Ok(())
    }
}

/// Nobody takes inputs any more.
#[derive(Debug)]
pub(crate) struct LoopEnded;

/// `None` when the folder cannot be read.
fn modified_at(folder: &PathBuf) -> Option<SystemTime> {
    fs::metadata(folder).and_then(|found| found.modified()).ok()
}

fn is_fresh(modified: &Option<SystemTime>) -> bool {
    // A time of change that lies ahead comes from a clock that was set back: not settled.
    modified.is_some_and(|at| at.elapsed().map_or(true, |age| age < SETTLED_AFTER))
}

#[cfg(test)]
pub(crate) mod tests {
    use std::os::unix::fs::PermissionsExt as _;
    use std::path::Path;

    use sdr_core::{
        report::RolePreference,
        units::{Bytes, Permille},
    };

    use super::*;

    pub(crate) fn facts() -> RobotFacts {
        RobotFacts {
            memory_capacity: Bytes::default(),
            cpu_capacity: Permille::default(),
            labels: Vec::new(),
            devices: Vec::new(),
            launchables: Vec::new(),
            role: RolePreference::Able,
            api: String::new(),
            version: String::new(),
        }
    }

    fn install(folder: &Path, name: &str, mode: u32) {
        fs::write(folder.join(name), "#!/bin/sh\n").unwrap();
        fs::set_permissions(folder.join(name), fs::Permissions::from_mode(mode)).unwrap();
    }

    fn age(folder: &Path) {
        let long_ago = SystemTime::now() - 2 * SETTLED_AFTER;
        fs::File::open(folder).unwrap().set_modified(long_ago).unwrap();
    }

    fn told(inputs: &mut mpsc::Receiver<Input>) -> Option<Vec<u32>> {
        let input = inputs.try_recv().ok()?;
        let Input::Facts(facts) = input else { panic!("{input:?}") };
        Some(facts.launchables)
    }

    #[tokio::test]
    async fn what_is_installed_or_removed_later_is_told_once() {
        let dir = tempfile::tempdir().unwrap();
        let (sender, mut inputs) = mpsc::channel(4);
        let installed = Installed::new((vec![dir.path().into()], vec![]), facts(), sender);
        installed.refresh(Look::Changed).await.unwrap();
        assert_eq!(told(&mut inputs), None);

        install(dir.path(), "camera", 0o755);
        installed.refresh(Look::Changed).await.unwrap();
        assert_eq!(told(&mut inputs), Some(vec![launch_hash("camera")]));
        installed.refresh(Look::Thorough).await.unwrap();
        assert_eq!(told(&mut inputs), None);

        fs::remove_file(dir.path().join("camera")).unwrap();
        installed.refresh(Look::Changed).await.unwrap();
        assert_eq!(told(&mut inputs), Some(vec![]));
    }

    #[tokio::test]
    async fn a_folder_that_did_not_change_is_read_only_thoroughly() {
        let dir = tempfile::tempdir().unwrap();
        install(dir.path(), "camera", 0o644);
        age(dir.path());
        let (sender, mut inputs) = mpsc::channel(4);
        let installed = Installed::new((vec![dir.path().into()], vec![]), facts(), sender);
        installed.refresh(Look::Changed).await.unwrap();

        let executable = fs::Permissions::from_mode(0o755);
        fs::set_permissions(dir.path().join("camera"), executable).unwrap();
        installed.refresh(Look::Changed).await.unwrap();
        assert_eq!(told(&mut inputs), None);
        installed.refresh(Look::Thorough).await.unwrap();
        assert_eq!(told(&mut inputs), Some(vec![launch_hash("camera")]));
    }

    #[tokio::test]
    async fn a_device_that_goes_and_comes_is_told_each_time() {
        let dir = tempfile::tempdir().unwrap();
        let file = dir.path().join("video0");
        let name = |word| Name::new(word).unwrap();
        let camera = Device { name: name("camera"), file: Some(file.clone()) };
        let wheels = Device { name: name("wheels"), file: None };
        let (sender, mut inputs) = mpsc::channel(4);
        let facts = RobotFacts { devices: present(std::slice::from_ref(&wheels)), ..facts() };
        let installed = Installed::new((vec![], vec![camera, wheels]), facts, sender);
        let mut told = || {
            let input = inputs.try_recv().ok()?;
            let Input::Facts(facts) = input else { panic!("{input:?}") };
            Some(facts.devices)
        };

        installed.refresh(Look::Devices).await.unwrap();
        assert_eq!(told(), None);

        fs::write(&file, "").unwrap();
        installed.refresh(Look::Devices).await.unwrap();
        assert_eq!(told(), Some(vec![name("camera"), name("wheels")]));

        fs::remove_file(&file).unwrap();
        installed.refresh(Look::Devices).await.unwrap();
        assert_eq!(told(), Some(vec![name("wheels")]));
    }

    #[tokio::test]
    async fn nothing_is_told_when_the_loop_has_ended() {
        let dir = tempfile::tempdir().unwrap();
        install(dir.path(), "camera", 0o755);
        let (sender, inputs) = mpsc::channel(4);
        drop(inputs);

        let installed = Installed::new((vec![dir.path().into()], vec![]), facts(), sender);

        assert!(installed.refresh(Look::Changed).await.is_err());
    }
}
