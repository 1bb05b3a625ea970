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

mod cast;
pub mod device;
pub mod noise;
pub mod optics;
pub mod radio;
pub mod tunnel;
pub mod world;

pub use world::{World, WorldConfig, WorldHandle};
