//! Package `nav_msgs`.

use serde::{Deserialize, Serialize};

use super::{
    geometry_msgs::{PoseWithCovariance, TwistWithCovariance},
    msg,
    std_msgs::Header,
};
use crate::plain_message;

/// Where something is and how it moves.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Odometry {
    /// The frame of the pose, and when.
    pub header: Header,
    /// The frame of the velocities.
    pub child_frame_id: String,
    /// Where.
    pub pose: PoseWithCovariance,
    /// How it moves.
    pub twist: TwistWithCovariance,
}

plain_message!(
    Odometry,
    "nav_msgs/msg/Odometry",
    "std_msgs/Header header\nstring child_frame_id\ngeometry_msgs/PoseWithCovariance pose\ngeometry_msgs/TwistWithCovariance twist\n",
    msg!("std_msgs/Header", "builtin_interfaces/Time stamp\nstring frame_id\n"),
    msg!("builtin_interfaces/Time", "int32 sec\nuint32 nanosec\n"),
    msg!("geometry_msgs/PoseWithCovariance", "Pose pose\nfloat64[36] covariance\n"),
    msg!("geometry_msgs/Pose", "Point position\nQuaternion orientation\n"),
    msg!("geometry_msgs/Point", "float64 x\nfloat64 y\nfloat64 z\n"),
    msg!("geometry_msgs/Quaternion", "float64 x 0\nfloat64 y 0\nfloat64 z 0\nfloat64 w 1\n"),
    msg!("geometry_msgs/TwistWithCovariance", "Twist twist\nfloat64[36] covariance\n"),
    msg!("geometry_msgs/Twist", "Vector3 linear\nVector3 angular\n"),
    msg!("geometry_msgs/Vector3", "float64 x\nfloat64 y\nfloat64 z\n"),
);
