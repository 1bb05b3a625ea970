//! What world to make.

use std::path::{Path, PathBuf};
use std::time::Duration;

use super::WorldError;
use crate::tunnel::{Pose, START};

/// Most robots in one world.
const ROBOTS_MAX: usize = 64;
/// Longest path of a Unix socket, bytes (`sun_path` with its end).
const SOCKET_PATH_BYTES_MAX: usize = 107;

/// A world to start.
#[derive(Debug, Clone)]
pub struct WorldConfig {
    /// Where the robots' folders go.
    pub folder: PathBuf,
    /// The robots, 1 to 64, names unique.
    pub rovers: Vec<RoverConfig>,
    /// Draws all noise.
    pub seed: u64,
    /// When the dangerous object comes and goes by itself.
    pub schedule: Vec<Appearance>,
}

impl WorldConfig {
    /// Rovers that keep station about the one with the wheels in use, which begins at
    /// [`START`].
    pub fn convoy(folder: &Path, leader: &str, followers: &[&str], seed: u64) -> Self {
        let mut rovers = vec![RoverConfig::new(leader, START)];
        for (index, name) in followers.iter().enumerate() {
            let row = index / 2 + 1;
            let side = if index % 2 == 0 { 0.35 } else { -0.35 };
            let offset = Pose::new(-0.5 * row as f64, side, 0.0);
            let drive = Drive::Station { leader: leader.to_owned(), offset };
            rovers.push(RoverConfig { drive, ..RoverConfig::new(name, START.at_offset(&offset)) });
        }
        Self { folder: folder.to_owned(), rovers, seed, schedule: Vec::new() }
    }

    pub(super) fn check(&self) -> Result<(), WorldError> {
        if self.rovers.is_empty() || self.rovers.len() > ROBOTS_MAX {
            let found = self.rovers.len();
            return Err(WorldError::RobotsCount { found, allowed: ROBOTS_MAX });
        }
        for (index, rover) in self.rovers.iter().enumerate() {
            let plain = |c: char| c.is_ascii_alphanumeric() || c == '-' || c == '_';
            if rover.name.is_empty() || !rover.name.chars().all(plain) {
                return Err(WorldError::Name { name: rover.name.clone() });
            }
            if self.rovers[..index].iter().any(|other| other.name == rover.name) {
                return Err(WorldError::Twice { name: rover.name.clone() });
            }
            let path = RobotPaths::new(&self.folder, &rover.name).fisheye;
            let found = path.as_os_str().len();
            if found > SOCKET_PATH_BYTES_MAX {
                return Err(WorldError::PathLong { path, found, allowed: SOCKET_PATH_BYTES_MAX });
            }
            if let Drive::Station { leader, .. } = &rover.drive {
                self.check_leader(leader)?;
            }
        }
        self.schedule.iter().try_for_each(|appearance| self.find(&appearance.ahead_of).map(|_| ()))
    }

    fn check_leader(&self, leader: &str) -> Result<(), WorldError> {
        match self.find(leader)?.drive {
            Drive::Commanded => Ok(()),
            Drive::Station { .. } => Err(WorldError::Leader { name: leader.to_owned() }),
        }
    }

    fn find(&self, name: &str) -> Result<&RoverConfig, WorldError> {
        self.rovers
            .iter()
            .find(|rover| rover.name == name)
            .ok_or_else(|| WorldError::UnknownRobot { name: name.to_owned() })
    }
}

/// One robot's body.
#[derive(Debug, Clone)]
pub struct RoverConfig {
    /// Name of its folder: letters, digits, `-` and `_`.
    pub name: String,
    /// Where it starts.
    pub start: Pose,
    /// What moves it.
    pub drive: Drive,
    /// Level of its radio before any fade, dBm.
    pub rssi_dbm: f64,
    /// Spread of the level, dB.
    pub rssi_sigma_db: f64,
    /// Battery at the start, percent.
    pub battery_percent: f64,
    /// How fast the battery drains, percent a minute.
    pub drain_percent_per_minute: f64,
}

impl RoverConfig {
    /// A commanded rover with the paper's radio (-47 dBm, 0.5 dB) and a battery of 80 %.
    pub fn new(name: &str, start: Pose) -> Self {
        Self {
            name: name.to_owned(),
            start,
            drive: Drive::Commanded,
            rssi_dbm: -47.0,
            rssi_sigma_db: 0.5,
            battery_percent: 80.0,
            drain_percent_per_minute: 0.5,
        }
    }
}

/// What moves a rover.
#[derive(Debug, Clone, PartialEq)]
pub enum Drive {
    /// Commands to its wheels.
    Commanded,
    /// It keeps a fixed place beside a commanded rover, which carries it along.
    Station {
        /// Which rover.
        leader: String,
        /// Where in that rover's frame.
        offset: Pose,
    },
}

/// A visit of the dangerous object.
#[derive(Debug, Clone, PartialEq)]
pub struct Appearance {
    /// When it comes, from the start of the world.
    pub from: Duration,
    /// When it goes.
    pub until: Duration,
    /// Before which robot it comes to stand.
    pub ahead_of: String,
    /// How far ahead, metres.
    pub distance_m: f64,
}

/// Where the devices and files of one robot are.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct RobotPaths {
    /// The robot's folder.
    pub folder: PathBuf,
    /// Socket of the fisheye.
    pub fisheye: PathBuf,
    /// Socket of the perspective camera.
    pub camera: PathBuf,
    /// Socket of the wheels.
    pub wheels: PathBuf,
    /// File in the format of /proc/net/wireless.
    pub wireless: PathBuf,
    /// File in the format of /sys/class/power_supply/*/capacity.
    pub battery: PathBuf,
}

impl RobotPaths {
    /// The paths of `robot` in a world's folder.
    pub fn new(folder: &Path, robot: &str) -> Self {
        let folder = folder.join(robot);
        Self {
            fisheye: folder.join("fisheye.sock"),
            camera: folder.join("camera.sock"),
            wheels: folder.join("wheels.sock"),
            wireless: folder.join("wireless"),
            battery: folder.join("battery"),
            folder,
        }
    }
}
