//! A world of rovers in a tunnel, in real time.
//!
//! Three threads: one moves the rovers (200 steps a second) and serves the wheels, one draws
//! pictures for whoever asks, one writes radio and battery files (10 times a second).

mod air;
mod bodies;
mod camera;
mod config;
mod error;
mod eyes;
mod handle;
mod peer;
pub(crate) mod rover;
mod state;
mod surface;

pub use camera::{CAMERA_HEIGHT_M, Camera, Scene};
pub use config::{Appearance, Drive, RobotPaths, RoverConfig, WorldConfig};
pub use error::WorldError;
pub use handle::WorldHandle;
pub use rover::{RADIUS_M, Rover, SPEED_MAX_M_S, TRACK_M, TURN_MAX_RAD_S, WATCHDOG_NS};
pub use state::{CommandGaps, RoverSnapshot, Snapshot, monotonic_ns};

/// The world; see [`World::start`].
#[derive(Debug)]
pub struct World;

impl World {
    /// Makes the folders and sockets of all robots and lets time begin.
    pub fn start(config: WorldConfig) -> Result<WorldHandle, WorldError> {
        config.check()?;
        handle::start(config)
    }
}
