//! The five components: ports, parameters and devices around what the other modules think.

mod anomaly;
mod controller;
mod eye;
mod pictures;
mod position;
mod wheels;

pub use anomaly::Anomaly;
pub use controller::MotionController;
pub use eye::{Eye, FisheyeCamera, Optics, PerspectiveCamera};
pub use pictures::{Pictures, PicturesError, Unreadable};
pub use position::PositionEstimation;

use std::time::Duration;

/// Longest wait for a device, at most five beats of the execution thread.
const DEVICE_TIMEOUT: Duration = Duration::from_millis(500);

/// The frame of the map.
const MAP_FRAME: &str = "map";
/// The frame in which wheels and gyro add up; it drifts.
const ODOMETRY_FRAME: &str = "odom";
/// The frame of the rover.
const BODY_FRAME: &str = "base_link";
