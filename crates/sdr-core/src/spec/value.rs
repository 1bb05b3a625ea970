//! Parameter values.

use alloc::{string::String, vec::Vec};
use core::fmt;

use serde::{Deserialize, Deserializer, Serialize, Serializer};

/// A parameter's value: what both YAML and ROS 2 parameters can say.
///
/// In JSON and YAML it is the bare value; on the mesh it carries its kind.
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

/// As people write it: no tags.
#[derive(Deserialize)]
#[serde(untagged)]
enum Bare {
    Bool(bool),
    Int(i64),
    Float(f64),
    Text(String),
    List(Vec<Value>),
}

/// As the mesh carries it: tagged.
#[derive(Serialize, Deserialize)]
enum Tagged {
    Bool(bool),
    Int(i64),
    Float(f64),
    Text(String),
    List(Vec<Value>),
}

impl From<Bare> for Value {
    fn from(bare: Bare) -> Self {
        match bare {
            Bare::Bool(flag) => Self::Bool(flag),
            Bare::Int(whole) => Self::Int(whole),
            Bare::Float(number) => Self::Float(number),
            Bare::Text(text) => Self::Text(text),
            Bare::List(items) => Self::List(items),
        }
    }
}

impl From<Tagged> for Value {
    fn from(tagged: Tagged) -> Self {
        match tagged {
            Tagged::Bool(flag) => Self::Bool(flag),
            Tagged::Int(whole) => Self::Int(whole),
            Tagged::Float(number) => Self::Float(number),
            Tagged::Text(text) => Self::Text(text),
            Tagged::List(items) => Self::List(items),
        }
    }
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
            let tagged = match self.clone() {
                Self::Bool(flag) => Tagged::Bool(flag),
                Self::Int(whole) => Tagged::Int(whole),
                Self::Float(number) => Tagged::Float(number),
                Self::Text(text) => Tagged::Text(text),
                Self::List(items) => Tagged::List(items),
            };
            tagged.serialize(serializer)
        }
    }
}

impl<'de> Deserialize<'de> for Value {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        if deserializer.is_human_readable() {
            Bare::deserialize(deserializer).map(Self::from)
        } else {
            Tagged::deserialize(deserializer).map(Self::from)
        }
    }
}
