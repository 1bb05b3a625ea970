//! Package `geometry_msgs`.

use serde::{Deserialize, Serialize};

use super::{covariance, msg, std_msgs::Header};
use crate::plain_message;

/// A free vector.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Vector3 {
    /// Forwards.
    pub x: f64,
    /// To the left.
    pub y: f64,
    /// Upwards.
    pub z: f64,
}

/// A place, metres.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Point {
    /// Forwards.
    pub x: f64,
    /// To the left.
    pub y: f64,
    /// Upwards.
    pub z: f64,
}

/// A turn.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Quaternion {
    /// First imaginary part.
    pub x: f64,
    /// Second imaginary part.
    pub y: f64,
    /// Third imaginary part.
    pub z: f64,
    /// Real part.
    pub w: f64,
}

impl Default for Quaternion {
    /// No turn.
    fn default() -> Self {
        Self { x: 0.0, y: 0.0, z: 0.0, w: 1.0 }
    }
}

impl Quaternion {
    /// A turn about the vertical, radians to the left.
    pub fn from_yaw(yaw: f64) -> Self {
        let (z, w) = (yaw / 2.0).sin_cos();
        Self { x: 0.0, y: 0.0, z, w }
    }

    /// The turn about the vertical, radians to the left, -pi..=pi.
    pub fn yaw(&self) -> f64 {
        let Self { x, y, z, w } = *self;
        (2.0 * (w * z + x * y)).atan2(1.0 - 2.0 * (y * y + z * z))
    }
}

/// A place and a turn.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Pose {
    /// Where.
    pub position: Point,
    /// How it is turned.
    pub orientation: Quaternion,
}

/// A pose with whence and when.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct PoseStamped {
    /// Whence and when.
    pub header: Header,
    /// The pose.
    pub pose: Pose,
}

/// A pose and how sure it is.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct PoseWithCovariance {
    /// The pose.
    pub pose: Pose,
    /// Rows of 6 by 6 over x, y, z and the turns about them.
    #[serde(with = "covariance")]
    pub covariance: [f64; 36],
}

impl Default for PoseWithCovariance {
    fn default() -> Self {
        Self { pose: Pose::default(), covariance: [0.0; 36] }
    }
}

/// Velocities: metres and radians a second.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Twist {
    /// Along the axes.
    pub linear: Vector3,
    /// About the axes.
    pub angular: Vector3,
}

/// Velocities and how sure they are.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct TwistWithCovariance {
    /// The velocities.
    pub twist: Twist,
    /// Rows of 6 by 6 over x, y, z and the turns about them.
    #[serde(with = "covariance")]
    pub covariance: [f64; 36],
}

impl Default for TwistWithCovariance {
    fn default() -> Self {
        Self { twist: Twist::default(), covariance: [0.0; 36] }
    }
}

plain_message!(Vector3, "geometry_msgs/msg/Vector3", "float64 x\nfloat64 y\nfloat64 z\n",);
plain_message!(Point, "geometry_msgs/msg/Point", "float64 x\nfloat64 y\nfloat64 z\n",);
plain_message!(
    Quaternion,
    "geometry_msgs/msg/Quaternion",
    "float64 x 0\nfloat64 y 0\nfloat64 z 0\nfloat64 w 1\n",
);
plain_message!(
    Pose,
    "geometry_msgs/msg/Pose",
    "Point position\nQuaternion orientation\n",
    msg!("geometry_msgs/Point", "float64 x\nfloat64 y\nfloat64 z\n"),
    msg!("geometry_msgs/Quaternion", "float64 x 0\nfloat64 y 0\nfloat64 z 0\nfloat64 w 1\n"),
);
plain_message!(
    PoseStamped,
    "geometry_msgs/msg/PoseStamped",
    "std_msgs/Header header\nPose pose\n",
    msg!("std_msgs/Header", "builtin_interfaces/Time stamp\nstring frame_id\n"),
    msg!("builtin_interfaces/Time", "int32 sec\nuint32 nanosec\n"),
    msg!("geometry_msgs/Pose", "Point position\nQuaternion orientation\n"),
    msg!("geometry_msgs/Point", "float64 x\nfloat64 y\nfloat64 z\n"),
    msg!("geometry_msgs/Quaternion", "float64 x 0\nfloat64 y 0\nfloat64 z 0\nfloat64 w 1\n"),
);
plain_message!(
    PoseWithCovariance,
    "geometry_msgs/msg/PoseWithCovariance",
    "Pose pose\nfloat64[36] covariance\n",
    msg!("geometry_msgs/Pose", "Point position\nQuaternion orientation\n"),
    msg!("geometry_msgs/Point", "float64 x\nfloat64 y\nfloat64 z\n"),
    msg!("geometry_msgs/Quaternion", "float64 x 0\nfloat64 y 0\nfloat64 z 0\nfloat64 w 1\n"),
);
plain_message!(
    Twist,
    "geometry_msgs/msg/Twist",
    "Vector3 linear\nVector3 angular\n",
    msg!("geometry_msgs/Vector3", "float64 x\nfloat64 y\nfloat64 z\n"),
);
plain_message!(
    TwistWithCovariance,
    "geometry_msgs/msg/TwistWithCovariance",
    "Twist twist\nfloat64[36] covariance\n",
    msg!("geometry_msgs/Twist", "Vector3 linear\nVector3 angular\n"),
    msg!("geometry_msgs/Vector3", "float64 x\nfloat64 y\nfloat64 z\n"),
);
