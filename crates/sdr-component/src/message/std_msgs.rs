//! Package `std_msgs`.

use serde::{Deserialize, Serialize};

use super::{builtin_interfaces::Time, msg};
use crate::plain_message;

/// Whence and when.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct Header {
    /// When it was measured.
    pub stamp: Time,
    /// In which frame of coordinates.
    pub frame_id: std::string::String,
}

plain_message!(
    Header,
    "std_msgs/msg/Header",
    "builtin_interfaces/Time stamp\nstring frame_id\n",
    msg!("builtin_interfaces/Time", "int32 sec\nuint32 nanosec\n"),
);

macro_rules! data_message {
    ($(#[$doc:meta])* $name:ident, $kind:ty, $type:literal, $text:literal, [$($derive:ident),*]) => {
        $(#[$doc])*
        #[derive(Clone, Debug, Default, PartialEq, $($derive,)* Serialize, Deserialize)]
        pub struct $name {
            /// The value.
            pub data: $kind,
        }
        plain_message!($name, $type, $text);
    };
}

data_message!(
    /// True or false.
    Bool, bool, "std_msgs/msg/Bool", "bool data\n", [Copy, Eq]
);
data_message!(
    /// Text.
    String, std::string::String, "std_msgs/msg/String", "string data\n", [Eq]
);
data_message!(
    /// 32 bits with a sign.
    Int32, i32, "std_msgs/msg/Int32", "int32 data\n", [Copy, Eq]
);
data_message!(
    /// 64 bits with a sign.
    Int64, i64, "std_msgs/msg/Int64", "int64 data\n", [Copy, Eq]
);
data_message!(
    /// 8 bits.
    UInt8, u8, "std_msgs/msg/UInt8", "uint8 data\n", [Copy, Eq]
);
data_message!(
    /// 32 bits.
    UInt32, u32, "std_msgs/msg/UInt32", "uint32 data\n", [Copy, Eq]
);
data_message!(
    /// 64 bits.
    UInt64, u64, "std_msgs/msg/UInt64", "uint64 data\n", [Copy, Eq]
);
data_message!(
    /// Single precision.
    Float32, f32, "std_msgs/msg/Float32", "float32 data\n", [Copy]
);
data_message!(
    /// Double precision.
    Float64, f64, "std_msgs/msg/Float64", "float64 data\n", [Copy]
);

/// Nothing but that it came. On the wire it is one byte, as ROS 2 has it.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct Empty {
    #[serde(rename = "structure_needs_at_least_one_member")]
    padding: u8,
}

plain_message!(Empty, "std_msgs/msg/Empty", "");
