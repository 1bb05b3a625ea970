//! Package `sensor_msgs`. Pictures are read and written in place.

use serde::{Deserialize, Serialize};

use super::{
    CdrError, CdrReader, CdrWriter, Encode, Message,
    builtin_interfaces::Time,
    geometry_msgs::{Quaternion, Vector3},
    msg,
    std_msgs::Header,
};
use crate::plain_message;

/// An inertial sensor's reading.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Imu {
    /// Whence and when.
    pub header: Header,
    /// How it is turned.
    pub orientation: Quaternion,
    /// First element -1: not measured.
    pub orientation_covariance: [f64; 9],
    /// Radians a second.
    pub angular_velocity: Vector3,
    /// Of that.
    pub angular_velocity_covariance: [f64; 9],
    /// Metres a second squared.
    pub linear_acceleration: Vector3,
    /// Of that.
    pub linear_acceleration_covariance: [f64; 9],
}

plain_message!(
    Imu,
    "sensor_msgs/msg/Imu",
    "std_msgs/Header header\ngeometry_msgs/Quaternion orientation\nfloat64[9] orientation_covariance\ngeometry_msgs/Vector3 angular_velocity\nfloat64[9] angular_velocity_covariance\ngeometry_msgs/Vector3 linear_acceleration\nfloat64[9] linear_acceleration_covariance\n",
    msg!("std_msgs/Header", "builtin_interfaces/Time stamp\nstring frame_id\n"),
    msg!("builtin_interfaces/Time", "int32 sec\nuint32 nanosec\n"),
    msg!("geometry_msgs/Quaternion", "float64 x 0\nfloat64 y 0\nfloat64 z 0\nfloat64 w 1\n"),
    msg!("geometry_msgs/Vector3", "float64 x\nfloat64 y\nfloat64 z\n"),
);

/// A battery's charge and health. Floats that were not measured are NaN.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct BatteryState {
    /// Whose battery it is, and when.
    pub header: Header,
    /// Volts.
    pub voltage: f32,
    /// Degrees Celsius.
    pub temperature: f32,
    /// Amperes; below zero while it discharges.
    pub current: f32,
    /// Ampere hours in it now.
    pub charge: f32,
    /// Ampere hours when it was full last.
    pub capacity: f32,
    /// Ampere hours as it was built.
    pub design_capacity: f32,
    /// Charge, 0 to 1.
    pub percentage: f32,
    /// 0 unknown, 1 charging, 2 discharging, 3 not charging, 4 full.
    pub power_supply_status: u8,
    /// 0 unknown, 1 good, more: what is wrong.
    pub power_supply_health: u8,
    /// 0 unknown, 1 NiMH, 2 Li-ion, 3 LiPo, 4 LiFe, 5 NiCd, 6 LiMn.
    pub power_supply_technology: u8,
    /// Whether there is one.
    pub present: bool,
    /// Volts of each cell.
    pub cell_voltage: Vec<f32>,
    /// Degrees Celsius of each cell.
    pub cell_temperature: Vec<f32>,
    /// Where it sits.
    pub location: String,
    /// As printed on it.
    pub serial_number: String,
}

plain_message!(
    BatteryState,
    "sensor_msgs/msg/BatteryState",
    "std_msgs/Header header\nfloat32 voltage\nfloat32 temperature\nfloat32 current\nfloat32 charge\nfloat32 capacity\nfloat32 design_capacity\nfloat32 percentage\nuint8 power_supply_status\nuint8 power_supply_health\nuint8 power_supply_technology\nbool present\nfloat32[] cell_voltage\nfloat32[] cell_temperature\nstring location\nstring serial_number\n",
    msg!("std_msgs/Header", "builtin_interfaces/Time stamp\nstring frame_id\n"),
    msg!("builtin_interfaces/Time", "int32 sec\nuint32 nanosec\n"),
);

/// A picture, as a type; what is sent and received is an [`ImageView`].
#[derive(Debug)]
pub enum Image {}

/// A picture in place.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct ImageView<'a> {
    /// When it was taken.
    pub stamp: Time,
    /// Whose picture it is.
    pub frame_id: &'a str,
    /// Rows.
    pub height: u32,
    /// Pixels in a row.
    pub width: u32,
    /// What a pixel is: `rgb8`, `mono8`, ...
    pub encoding: &'a str,
    /// Whether numbers of several bytes have the great end first.
    pub is_bigendian: u8,
    /// Bytes in a row.
    pub step: u32,
    /// The rows from the top.
    pub data: &'a [u8],
}

impl<'a> ImageView<'a> {
    /// A picture of red, green, blue bytes without gaps between the rows.
    pub fn rgb8(stamp: Time, frame_id: &'a str, width: u32, height: u32, data: &'a [u8]) -> Self {
        let step = width.saturating_mul(3);
        Self { stamp, frame_id, height, width, encoding: "rgb8", is_bigendian: 0, step, data }
    }

    /// How long such a message with `count` bytes of picture is.
    pub fn encoded_len_with(&self, count: usize) -> usize {
        let frame = 8 + 4 + self.frame_id.len() + 1;
        let encoding = frame.next_multiple_of(4) + 8 + 4 + self.encoding.len() + 1;
        (encoding + 1).next_multiple_of(4) + 8 + count
    }

    /// Writes everything before the picture and returns the room for its `count` bytes;
    /// `self.data` is not looked at.
    pub fn begin<'out>(
        &self,
        count: usize,
        out: &'out mut [u8],
    ) -> Result<&'out mut [u8], CdrError> {
        let head = self.encoded_len_with(0);
        let len = out.len();
        if len < head + count {
            return Err(CdrError::Short { at: 0, needed: head + count, left: len });
        }
        let (before, data) = out.split_at_mut(head - 4);
        let mut writer = CdrWriter::new(before);
        writer.i32(self.stamp.sec)?;
        writer.u32(self.stamp.nanosec)?;
        writer.string(self.frame_id)?;
        writer.u32(self.height)?;
        writer.u32(self.width)?;
        writer.string(self.encoding)?;
        writer.u8(self.is_bigendian)?;
        writer.u32(self.step)?;
        let (length, data) = data.split_at_mut(4);
        CdrWriter::new(length).u32(u32::try_from(count).unwrap_or(u32::MAX))?;
        Ok(&mut data[..count])
    }
}

impl Encode for ImageView<'_> {
    fn encoded_len(&self) -> usize {
        self.encoded_len_with(self.data.len())
    }

    fn encode(&self, out: &mut [u8]) -> Result<(), CdrError> {
        self.begin(self.data.len(), out)?.copy_from_slice(self.data);
        Ok(())
    }
}

impl Message for Image {
    const TYPE: &'static str = "sensor_msgs/msg/Image";
    const DEFINITION: &'static str = concat!(
        "std_msgs/Header header\nuint32 height\nuint32 width\nstring encoding\nuint8 is_bigendian\nuint32 step\nuint8[] data\n",
        msg!("std_msgs/Header", "builtin_interfaces/Time stamp\nstring frame_id\n"),
        msg!("builtin_interfaces/Time", "int32 sec\nuint32 nanosec\n"),
    );
    type View<'a> = ImageView<'a>;

    fn decode(bytes: &[u8]) -> Result<ImageView<'_>, CdrError> {
        let mut reader = CdrReader::new(bytes);
        Ok(ImageView {
            stamp: Time { sec: reader.i32()?, nanosec: reader.u32()? },
            frame_id: reader.string()?,
            height: reader.u32()?,
            width: reader.u32()?,
            encoding: reader.string()?,
            is_bigendian: reader.u8()?,
            step: reader.u32()?,
            data: reader.byte_sequence()?,
        })
    }
}

/// A compressed picture, as a type; what is sent and received is a [`CompressedImageView`].
#[derive(Debug)]
pub enum CompressedImage {}

/// A compressed picture in place.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct CompressedImageView<'a> {
    /// When it was taken.
    pub stamp: Time,
    /// Whose picture it is.
    pub frame_id: &'a str,
    /// `jpeg`, `png`, ...
    pub format: &'a str,
    /// The compressed bytes.
    pub data: &'a [u8],
}

impl Encode for CompressedImageView<'_> {
    fn encoded_len(&self) -> usize {
        let frame = 8 + 4 + self.frame_id.len() + 1;
        let format = frame.next_multiple_of(4) + 4 + self.format.len() + 1;
        format.next_multiple_of(4) + 4 + self.data.len()
    }

    fn encode(&self, out: &mut [u8]) -> Result<(), CdrError> {
        let mut writer = CdrWriter::new(out);
        writer.i32(self.stamp.sec)?;
        writer.u32(self.stamp.nanosec)?;
        writer.string(self.frame_id)?;
        writer.string(self.format)?;
        writer.byte_sequence(self.data.len())?.copy_from_slice(self.data);
        Ok(())
    }
}

impl Message for CompressedImage {
    const TYPE: &'static str = "sensor_msgs/msg/CompressedImage";
    const DEFINITION: &'static str = concat!(
        "std_msgs/Header header\nstring format\nuint8[] data\n",
        msg!("std_msgs/Header", "builtin_interfaces/Time stamp\nstring frame_id\n"),
        msg!("builtin_interfaces/Time", "int32 sec\nuint32 nanosec\n"),
    );
    type View<'a> = CompressedImageView<'a>;

    fn decode(bytes: &[u8]) -> Result<CompressedImageView<'_>, CdrError> {
        let mut reader = CdrReader::new(bytes);
        Ok(CompressedImageView {
            stamp: Time { sec: reader.i32()?, nanosec: reader.u32()? },
            frame_id: reader.string()?,
            format: reader.string()?,
            data: reader.byte_sequence()?,
        })
    }
}
