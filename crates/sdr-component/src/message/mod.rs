//! ROS 2 messages as they travel: CDR, little endian, without the 4-byte encapsulation header.
//!
//! One file a package. Small messages are plain structs that go through `serde`; pictures are
//! written straight into shared memory and read in place by a borrowed view
//! ([`sensor_msgs::ImageView`]). Lengths in received bytes are bounds, not claims: bodies may
//! carry up to 3 bytes of padding at the end, and no bytes at all make a reader panic.
//!
//! A message of your own: a struct in field order, `serde`, and [`plain_message!`](crate::plain_message).

pub mod builtin_interfaces;
mod cdr;
mod covariance;
pub mod geometry_msgs;
pub mod nav_msgs;
pub mod sensor_msgs;
pub mod std_msgs;

use serde::{Serialize, de::DeserializeOwned};
use thiserror::Error;

pub use cdr::{CdrReader, CdrWriter};

/// Bytes that are not the message, or a message that does not fit its bytes.
#[derive(Clone, Debug, PartialEq, Eq, Error)]
#[non_exhaustive]
pub enum CdrError {
    /// The bytes end within the message, or the memory is too short for it.
    #[error("{needed} bytes at {at}, only {left} are left")]
    Short {
        /// Where.
        at: usize,
        /// What the next field takes.
        needed: usize,
        /// What is there.
        left: usize,
    },
    /// A string without its end or not UTF-8, a length that cannot be.
    #[error("{what} at {at}")]
    Wrong {
        /// What is wrong.
        what: &'static str,
        /// Where.
        at: usize,
    },
    /// The `serde` half says so.
    #[error("{0}")]
    Other(String),
}

/// Something that can be written as a message.
pub trait Encode {
    /// Exactly how many bytes [`Self::encode`] writes.
    fn encoded_len(&self) -> usize;

    /// Writes it to the beginning of `out`, which has at least [`Self::encoded_len`] bytes.
    ///
    /// Writes every byte of that length, paddings too.
    fn encode(&self, out: &mut [u8]) -> Result<(), CdrError>;
}

/// A ROS 2 message type.
pub trait Message: 'static {
    /// ROS 2 name, such as `sensor_msgs/msg/Image`.
    const TYPE: &'static str;
    /// The `.msg` text with the texts of the types it uses, as `ros2msg` schemas hold it.
    const DEFINITION: &'static str;
    /// What is sent and received: the message itself, or a borrowed view of a large one.
    type View<'a>: Encode;

    /// Reads one; large parts stay where they are.
    fn decode(bytes: &[u8]) -> Result<Self::View<'_>, CdrError>;
}

/// The `.msg` text of the types that this crate knows, by name (`std_msgs/msg/Bool`).
pub fn definition_of(message_type: &str) -> Option<&'static str> {
    KNOWN.iter().find(|(name, _)| *name == message_type).map(|(_, text)| *text)
}

/// All types that this crate knows, with their `.msg` texts.
pub fn known() -> &'static [(&'static str, &'static str)] {
    KNOWN
}

macro_rules! entries {
    ($($package:ident: $($name:ident)*;)*) => {
        &[$($((
            <$package::$name as Message>::TYPE,
            <$package::$name as Message>::DEFINITION,
        ),)*)*]
    };
}

static KNOWN: &[(&str, &str)] = entries! {
    builtin_interfaces: Time Duration;
    std_msgs: Header Bool String Empty Int32 Int64 UInt8 UInt32 UInt64 Float32 Float64;
    geometry_msgs: Vector3 Point Quaternion Pose PoseStamped PoseWithCovariance Twist
        TwistWithCovariance;
    nav_msgs: Odometry;
    sensor_msgs: Image CompressedImage Imu BatteryState;
};

/// Makes a struct that has `serde` a [`Message`] that is sent and received whole.
///
/// ```
/// use sdr_component::{message::Message, plain_message};
///
/// #[derive(Debug, Clone, serde::Serialize, serde::Deserialize)]
/// pub struct Battery {
///     pub volts: f32,
/// }
/// plain_message!(Battery, "my_msgs/msg/Battery", "float32 volts\n");
///
/// assert_eq!(Battery::TYPE, "my_msgs/msg/Battery");
/// ```
#[macro_export]
macro_rules! plain_message {
    ($name:ty, $type:literal, $($definition:expr),+ $(,)?) => {
        impl $crate::message::Encode for $name {
            fn encoded_len(&self) -> usize {
                $crate::message::plain_len(self)
            }

            fn encode(&self, out: &mut [u8]) -> Result<(), $crate::message::CdrError> {
                $crate::message::plain_encode(self, out)
            }
        }

        impl $crate::message::Message for $name {
            const TYPE: &'static str = $type;
            const DEFINITION: &'static str = concat!($($definition),+);
            type View<'a> = Self;

            fn decode(bytes: &[u8]) -> Result<Self, $crate::message::CdrError> {
                $crate::message::plain_decode(bytes)
            }
        }
    };
}

/// Used by [`plain_message!`](crate::plain_message): the length of `value` in CDR.
#[doc(hidden)]
pub fn plain_len<T: Serialize>(value: &T) -> usize {
    let mut count = cdr::Count(0);
    // Counting cannot fail; a type that CDR does not know fails in `plain_encode`.
    let _ = cdr_encoding::to_writer::<T, byteorder::LittleEndian, _>(&mut count, value);
    count.0
}

/// Used by [`plain_message!`](crate::plain_message): writes `value` in CDR.
#[doc(hidden)]
pub fn plain_encode<T: Serialize>(value: &T, mut out: &mut [u8]) -> Result<(), CdrError> {
    cdr_encoding::to_writer::<T, byteorder::LittleEndian, _>(&mut out, value)
        .map_err(|error| CdrError::Other(error.to_string()))
}

/// Used by [`plain_message!`](crate::plain_message): reads a value from CDR.
#[doc(hidden)]
pub fn plain_decode<T: DeserializeOwned>(bytes: &[u8]) -> Result<T, CdrError> {
    match cdr_encoding::from_bytes::<T, byteorder::LittleEndian>(bytes) {
        Ok((value, _)) => Ok(value),
        Err(error) => Err(CdrError::Other(error.to_string())),
    }
}

/// The line between the texts of a `ros2msg` schema, with the name of the next one.
macro_rules! msg {
    ($name:literal, $text:expr) => {
        concat!(
            "================================================================================\n",
            "MSG: ",
            $name,
            "\n",
            $text
        )
    };
}
pub(crate) use msg;

#[cfg(test)]
mod tests;
