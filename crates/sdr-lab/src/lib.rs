//! The lab: a small world for robots that are not there.
//!
//! ```text
//!   world::World ---- rovers, tunnel, object ----> world::Camera (pictures)
//!       |                                             |
//!       |  wheels.sock: readings out, commands in     |  camera.sock, fisheye.sock
//!       v                                             v
//!   device::WheelsClient                        device::CameraClient      <- components
//!
//!   radio::RadioModel -> <robot>/wireless, <robot>/battery                <- agents
//! ```
//!
//! [`World::start`] runs in real time on its own threads, seeded; a component process is a
//! client of its robot's device sockets and cannot tell the world from a body. The agents read
//! radio and battery from files in the formats of Linux.
//!
//! ```
//! use sdr_lab::device::{Command, WheelsClient};
//! use sdr_lab::{World, WorldConfig};
//! use std::time::Duration;
//!
//! # fn main() -> Result<(), Box<dyn std::error::Error>> {
//! let folder = tempfile::tempdir()?;
//! let world = World::start(WorldConfig::convoy(folder.path(), "robot-2", &["robot-1"], 1))?;
//! let mut wheels = WheelsClient::connect(&world.paths()[0].wheels, Duration::from_secs(5))?;
//! wheels.command(Command { linear: 0.3, angular: 0.0 })?;
//! assert!(!wheels.wait(Duration::from_secs(5))?.is_empty());
//! world.stop();
//! # Ok(())
//! # }
//! ```

pub mod bed;
mod cast;
pub mod device;
pub mod noise;
pub mod optics;
pub mod radio;
pub mod sim;
pub mod tunnel;
pub mod world;

pub use world::{World, WorldConfig, WorldHandle};
