//! Parameter values.

mod read;

use alloc::{string::String, vec::Vec};
use core::fmt;

use serde::{Serialize, Serializer};

/// How deep lists may stand in each other: whoever reads them needs a bounded stack.
pub const LISTS_DEEP_MAX: usize = 16;

/// A parameter's value: what both YAML and ROS 2 parameters can say.
///
/// In JSON and YAML it is the bare value; on the mesh it carries its kind. Lists stand at most
/// [`LISTS_DEEP_MAX`] deep in each other.
#[derive(Clone, Debug)]
pub enum Value {
    /// `true` or `false`.
    Bool(bool),
    /// A whole number.
    Int(i64),
    /// A number with a fraction; never NaN in files.
    Float(f64),
    /// Text.
    Text(String),
    /// A list.
    List(Vec<Self>),
}

impl PartialEq for Value {
    /// Floats compare by their bits, so that equality is total.
    fn eq(&self, other: &Self) -> bool {
        match (self, other) {
            (Self::Bool(a), Self::Bool(b)) => a == b,
            (Self::Int(a), Self::Int(b)) => a == b,
            (Self::Float(a), Self::Float(b)) => a.to_bits() == b.to_bits(),
            (Self::Text(a), Self::Text(b)) => a == b,
            (Self::List(a), Self::List(b)) => a == b,
            (Self::Bool(_) | Self::Int(_) | Self::Float(_) | Self::Text(_) | Self::List(_), _) => {
                false
            }
        }
    }
}

impl Eq for Value {}

impl Value {
    /// The kind in words, for errors.
    pub fn kind(&self) -> &'static str {
        match self {
            Self::Bool(_) => "true or false",
            Self::Int(_) => "a whole number",
            Self::Float(_) => "a number",
            Self::Text(_) => "text",
            Self::List(_) => "a list",
        }
    }

    /// As a number, when it is one.
    #[expect(clippy::cast_precision_loss, reason = "parameters beyond 2^53 are not quantities")]
    pub fn as_f64(&self) -> Option<f64> {
        match self {
            Self::Int(whole) => Some(*whole as f64),
            Self::Float(number) => Some(*number),
            Self::Bool(_) | Self::Text(_) | Self::List(_) => None,
        }
    }
}

impl fmt::Display for Value {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Bool(flag) => write!(f, "{flag}"),
            Self::Int(whole) => write!(f, "{whole}"),
            Self::Float(number) => write!(f, "{number}"),
            Self::Text(text) => f.write_str(text),
            Self::List(items) => {
                f.write_str("[")?;
                for (index, item) in items.iter().enumerate() {
                    let comma = if index == 0 { "" } else { ", " };
                    write!(f, "{comma}{item}")?;
                }
                f.write_str("]")
            }
        }
    }
}

/// As the mesh carries it: tagged.
#[derive(Serialize)]
enum Tagged<'a> {
    Bool(bool),
    Int(i64),
    Float(f64),
    Text(&'a str),
    List(&'a [Value]),
}

impl Serialize for Value {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        if serializer.is_human_readable() {
            match self {
                Self::Bool(flag) => flag.serialize(serializer),
                Self::Int(whole) => whole.serialize(serializer),
                Self::Float(number) => number.serialize(serializer),
                Self::Text(text) => text.serialize(serializer),
                Self::List(items) => items.serialize(serializer),
            }
        } else {
            let tagged = match self {
                Self::Bool(flag) => Tagged::Bool(*flag),
                Self::Int(whole) => Tagged::Int(*whole),
                Self::Float(number) => Tagged::Float(*number),
                Self::Text(text) => Tagged::Text(text),
                Self::List(items) => Tagged::List(items),
            };
            tagged.serialize(serializer)
        }
    }
}
