//! Plain values and quantities of files.

use std::{borrow::Cow, time::Duration};

use schemars::{JsonSchema, Schema, SchemaGenerator, json_schema};
use sdr_core::{
    id::{Name, NameError, RobotId},
    units::{Bytes, Dbm, Permille},
};

use crate::{
    problem::Mark,
    read::{Read, Reader},
    tree::{Body, Node},
    units::{self, UnitError},
};

/// A value and where it stands.
#[derive(Clone, Debug)]
pub(crate) struct At<T> {
    pub(crate) value: T,
    pub(crate) mark: Mark,
}

impl<T> At<T> {
    /// Another value at the same place.
    pub(crate) fn map<U>(self, change: impl FnOnce(T) -> U) -> At<U> {
        At { value: change(self.value), mark: self.mark }
    }
}

impl<T: Read> Read for At<T> {
    fn read(node: &Node, reader: &mut Reader) -> Option<Self> {
        T::read(node, reader).map(|value| Self { value, mark: node.mark })
    }

    fn schema(generator: &mut SchemaGenerator) -> Schema {
        T::schema(generator)
    }
}

impl<T: Read> JsonSchema for At<T> {
    fn inline_schema() -> bool {
        true
    }

    fn schema_name() -> Cow<'static, str> {
        Cow::Borrowed("Value")
    }

    fn json_schema(generator: &mut SchemaGenerator) -> Schema {
        T::schema(generator)
    }
}

/// A key that must be there, but whose value may have been told as a problem: the rest of
/// the table is still judged.
#[derive(Clone, Debug)]
pub(crate) struct Need<T>(pub(crate) Option<T>);

impl<T: Read> Read for Need<T> {
    fn read(node: &Node, reader: &mut Reader) -> Option<Self> {
        Some(Self(T::read(node, reader)))
    }

    fn schema(generator: &mut SchemaGenerator) -> Schema {
        T::schema(generator)
    }
}

impl<T: Read> JsonSchema for Need<T> {
    fn inline_schema() -> bool {
        true
    }

    fn schema_name() -> Cow<'static, str> {
        Cow::Borrowed("Need")
    }

    fn json_schema(generator: &mut SchemaGenerator) -> Schema {
        T::schema(generator)
    }
}

/// A key that may be missing. A value that cannot be read is told and then counts as
/// missing, so that the rest of the file is still judged.
impl<T: Read> Read for Option<T> {
    fn read(node: &Node, reader: &mut Reader) -> Option<Self> {
        Some(T::read(node, reader))
    }

    fn absent() -> Option<Self> {
        Some(None)
    }

    fn schema(generator: &mut SchemaGenerator) -> Schema {
        T::schema(generator)
    }
}

/// A list; entries that cannot be read are told and left out.
impl<T: Read> Read for Vec<T> {
    fn read(node: &Node, reader: &mut Reader) -> Option<Self> {
        match &node.body {
            Body::List(items) => {
                Some(items.iter().filter_map(|item| T::read(item, reader)).collect())
            }
            Body::Nothing
            | Body::Bool(_)
            | Body::Int(_)
            | Body::Float(_)
            | Body::Text(_)
            | Body::Table(_) => {
                reader.wrong(node, "a list such as [a, b]");
                None
            }
        }
    }

    fn schema(generator: &mut SchemaGenerator) -> Schema {
        json_schema!({ "type": "array", "items": T::schema(generator) })
    }
}

/// A table whose keys are free; a value that cannot be read is told and `None`.
#[derive(Clone, Debug)]
pub(crate) struct Map<T>(pub(crate) Vec<(At<String>, Option<T>)>);

impl<T: Read> Read for Map<T> {
    fn read(node: &Node, reader: &mut Reader) -> Option<Self> {
        let Body::Table(entries) = &node.body else {
            reader.wrong(node, "a table of names");
            return None;
        };
        let read = |(key, value): &(crate::tree::Key, Node)| {
            let key = At { value: key.word.clone(), mark: key.mark };
            (key, T::read(value, reader))
        };
        Some(Self(entries.iter().map(read).collect()))
    }

    fn schema(generator: &mut SchemaGenerator) -> Schema {
        json_schema!({ "type": "object", "additionalProperties": T::schema(generator) })
    }
}

impl<T: Read> JsonSchema for Map<T> {
    fn inline_schema() -> bool {
        true
    }

    fn schema_name() -> Cow<'static, str> {
        Cow::Borrowed("Map")
    }

    fn json_schema(generator: &mut SchemaGenerator) -> Schema {
        Self::schema(generator)
    }
}

impl Read for bool {
    fn read(node: &Node, reader: &mut Reader) -> Option<Self> {
        if let Body::Bool(flag) = node.body {
            return Some(flag);
        }
        reader.wrong(node, "true, false");
        None
    }

    fn schema(_: &mut SchemaGenerator) -> Schema {
        json_schema!({ "type": "boolean" })
    }
}

impl Read for String {
    fn read(node: &Node, reader: &mut Reader) -> Option<Self> {
        let text = reader.text(node, "text")?;
        if text.is_empty() {
            reader.problem(node.mark, "the text is empty", None);
            return None;
        }
        Some(text.to_owned())
    }

    fn schema(_: &mut SchemaGenerator) -> Schema {
        json_schema!({ "type": "string", "minLength": 1 })
    }
}

impl Read for f64 {
    #[expect(clippy::cast_precision_loss, reason = "weights beyond 2^53 are not written by people")]
    fn read(node: &Node, reader: &mut Reader) -> Option<Self> {
        match node.body {
            Body::Int(number) => Some(number as Self),
            Body::Float(number) if number.is_finite() => Some(number),
            Body::Nothing
            | Body::Bool(_)
            | Body::Float(_)
            | Body::Text(_)
            | Body::List(_)
            | Body::Table(_) => {
                reader.wrong(node, "a number");
                None
            }
        }
    }

    fn schema(_: &mut SchemaGenerator) -> Schema {
        json_schema!({ "type": "number" })
    }
}

macro_rules! whole_numbers {
    ($($type:ty),*) => {$(
        impl Read for $type {
            fn read(node: &Node, reader: &mut Reader) -> Option<Self> {
                if let Body::Int(number) = node.body
                    && let Ok(number) = Self::try_from(number)
                {
                    return Some(number);
                }
                reader.wrong(node, &format!("a whole number, {} to {}", Self::MIN, Self::MAX));
                None
            }

            fn schema(_: &mut SchemaGenerator) -> Schema {
                json_schema!({ "type": "integer", "minimum": Self::MIN, "maximum": Self::MAX })
            }
        }
    )*};
}
whole_numbers!(i8, u8, u16, u32);

/// The type of a function that makes a quantity of a word.
type Parse<T> = fn(&str) -> Result<T, UnitError>;

/// A quantity out of `node`; `allowed` stands in the error.
pub(crate) fn quantity<T>(
    node: &Node,
    reader: &mut Reader,
    parse: Parse<T>,
    allowed: &str,
) -> Option<T> {
    let text = match &node.body {
        Body::Int(number) => Cow::Owned(number.to_string()),
        Body::Float(number) => Cow::Owned(number.to_string()),
        Body::Text(text) => Cow::Borrowed(text.as_str()),
        Body::Nothing | Body::Bool(_) | Body::List(_) | Body::Table(_) => {
            reader.wrong(node, allowed);
            return None;
        }
    };
    match parse(&text) {
        Ok(value) => Some(value),
        Err(error) => {
            reader.problem(node.mark, error.to_string(), Some(format!("allowed: {allowed}")));
            None
        }
    }
}

macro_rules! quantities {
    ($($type:ty, $parse:path, $help:path, $pattern:literal;)*) => {$(
        impl Read for $type {
            fn read(node: &Node, reader: &mut Reader) -> Option<Self> {
                quantity(node, reader, $parse, $help)
            }

            fn schema(_: &mut SchemaGenerator) -> Schema {
                json_schema!({ "type": "string", "pattern": $pattern, "description": $help })
            }
        }
    )*};
}
quantities! {
    Bytes, units::size, units::SIZE_HELP, r"^[0-9]+(\.[0-9]+)? *(B|kB|MB|GB|TB|KiB|MiB|GiB)$";
    Duration, units::duration, units::DURATION_HELP, r"^[0-9]+(\.[0-9]+)? *(ns|us|ms|s|min|h)$";
    Permille, units::share, units::SHARE_HELP, r"^[0-9]+(\.[0-9])? *%$";
    Dbm, units::level, units::LEVEL_HELP, r"^-?[0-9]+(\.[0-9])? *dBm$";
}

fn name<T>(node: &Node, reader: &mut Reader, new: fn(&str) -> Result<T, NameError>) -> Option<T> {
    let text = reader.text(node, "a name such as red_box")?;
    match new(text) {
        Ok(name) => Some(name),
        Err(error) => {
            reader.problem(node.mark, error.to_string(), None);
            None
        }
    }
}

impl Read for Name {
    fn read(node: &Node, reader: &mut Reader) -> Option<Self> {
        name(node, reader, Self::new)
    }

    fn schema(_: &mut SchemaGenerator) -> Schema {
        json_schema!({ "type": "string", "pattern": "^[a-z](_?[a-z0-9])*_?$", "maxLength": 32 })
    }
}

impl Read for RobotId {
    fn read(node: &Node, reader: &mut Reader) -> Option<Self> {
        name(node, reader, Self::new)
    }

    fn schema(_: &mut SchemaGenerator) -> Schema {
        json_schema!({ "type": "string", "pattern": "^[a-z]([_]?[a-z0-9-])*_?$", "maxLength": 32 })
    }
}
