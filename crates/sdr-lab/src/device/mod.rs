//! The devices of a body, as Unix stream sockets: one JSON object a line, and raw pictures.
//!
//! Every device greets first: `{"device":"camera","protocol":1,"robot":"robot-2",...}`.
//!
//! **Camera** (`camera.sock`, `fisheye.sock`). The greeting adds `width`, `height` and `lens`.
//!
//! ```text
//! client  {"get":"frame"}
//! device  {"frame":{"sequence":7,"stamp_ns":..,"width":160,"height":120,"bytes":57600}}
//!         then that many bytes: rows from the top, red, green, blue
//! ```
//!
//! A picture is drawn when somebody asks; clients that ask at once share one. Several clients
//! may be connected.
//!
//! **Wheels** (`wheels.sock`). The greeting adds `rate_hz`. Readings come unasked; a reader
//! too slow for them loses the newest. Commands hold until the next one, whoever sends it, or
//! until 500 ms without any have passed; then the rover stops.
//!
//! ```text
//! device  {"reading":{"stamp_ns":..,"sequence":..,"left_m":..,"right_m":..,"gyro_rad_s":..,..}}
//! client  {"linear":0.3,"angular":0.0}          metres and radians a second
//! ```
//!
//! **Bounds.** A line has at most [`LINE_BYTES_MAX`] bytes, a device [`CLIENTS_MAX`] clients.
//! What cannot be understood is answered by `{"error":"line 3: .."}`; after
//! [`ERRORS_MAX`] errors, or a line too long, the device hangs up. Others do not notice.

mod camera;
mod error;
mod line;
mod wheels;

use serde::{Deserialize, Serialize};

pub use camera::{CameraClient, Frame};
pub use error::DeviceError;
pub(crate) use line::LineBuffer;
pub use wheels::WheelsClient;
pub(crate) use wheels::check as check_command;

pub use crate::world::rover::{Command, WheelReading};

use crate::optics::Lens;

/// Version of what is said on these sockets.
pub const PROTOCOL: u32 = 1;
/// Longest line, bytes, its end included.
pub const LINE_BYTES_MAX: usize = 512;
/// Most clients of one device at a time.
pub const CLIENTS_MAX: usize = 16;
/// After so many errors a device hangs up.
pub const ERRORS_MAX: u32 = 10;
/// Largest picture a client accepts, bytes.
pub const PICTURE_BYTES_MAX: usize = 16 << 20;

/// Which kind of device greets.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum DeviceKind {
    /// Pictures of a perspective lens.
    Camera,
    /// Pictures of a fisheye.
    Fisheye,
    /// Wheels with encoders and an inertial sensor.
    Wheels,
}

/// The first line of every device.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Greeting {
    /// What this is.
    pub device: DeviceKind,
    /// [`PROTOCOL`].
    pub protocol: u32,
    /// Whose body this is.
    pub robot: String,
    /// Pictures: pixels in a row.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub width: Option<usize>,
    /// Pictures: rows.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub height: Option<usize>,
    /// Pictures: the lens.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub lens: Option<Lens>,
    /// Wheels: readings a second.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub rate_hz: Option<u32>,
}

/// What a camera is asked.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case", deny_unknown_fields)]
pub(crate) enum CameraRequest {
    Get(Wanted),
}

#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub(crate) enum Wanted {
    Frame,
}

/// Goes before the bytes of a picture.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
pub(crate) struct FrameHeader {
    pub(crate) sequence: u64,
    pub(crate) stamp_ns: u64,
    pub(crate) width: usize,
    pub(crate) height: usize,
    pub(crate) bytes: usize,
}

/// What a camera answers.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub(crate) enum CameraAnswer {
    Frame(FrameHeader),
    Error(String),
}

/// What the wheels say.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub(crate) enum WheelsAnswer {
    Reading(WheelReading),
    Error(String),
}

/// One line of what is said: JSON and its end.
pub(crate) fn line_of<T: Serialize>(value: &T) -> Vec<u8> {
    let mut line = serde_json::to_vec(value).expect("these types have only string keys");
    line.push(b'\n');
    line
}
