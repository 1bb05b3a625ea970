//! Values that only scenarios have.

use std::borrow::Cow;

use schemars::{JsonSchema, Schema, SchemaGenerator, json_schema};
use sdr_core::{id::RobotId, lifecycle::LifecycleState};

use super::types::{Blow, Cut, Place};
use crate::{
    read::{At, Read, Reader, choices, quantity},
    tree::{Body, Node},
    units,
};

/// `all`, one robot, or a list of robots.
#[derive(Clone, Debug)]
pub(crate) enum Robots {
    All,
    These(Vec<At<RobotId>>),
}

impl Read for Robots {
    fn read(node: &Node, reader: &mut Reader) -> Option<Self> {
        match &node.body {
            Body::Text(word) if word == "all" => Some(Self::All),
            Body::List(items) if items.is_empty() => {
                reader.wrong(node, "all, a robot, or a list of robots such as [robot-1, robot-2]");
                None
            }
            Body::List(_) => Vec::read(node, reader).map(Self::These),
            Body::Text(_) => At::read(node, reader).map(|one| Self::These(vec![one])),
            Body::Nothing | Body::Bool(_) | Body::Int(_) | Body::Float(_) | Body::Table(_) => {
                reader.wrong(node, "all, a robot, or a list of robots such as [robot-1, robot-2]");
                None
            }
        }
    }

    fn schema(generator: &mut SchemaGenerator) -> Schema {
        json_schema!({ "anyOf": [
            { "const": "all" },
            RobotId::schema(generator),
            Vec::<RobotId>::schema(generator),
        ] })
    }
}

impl Read for Place {
    fn read(node: &Node, reader: &mut Reader) -> Option<Self> {
        let Body::List(items) = &node.body else {
            reader.wrong(node, "x and y such as [3m, -1.5m]");
            return None;
        };
        let [x, y] = items.as_slice() else {
            reader.wrong(node, "exactly x and y such as [3m, -1.5m]");
            return None;
        };
        let mut one = |node| quantity(node, reader, units::offset_mm, units::OFFSET_HELP);
        let (x_mm, y_mm) = (one(x), one(y));
        Some(Self { x_mm: x_mm?, y_mm: y_mm? })
    }

    fn schema(_: &mut SchemaGenerator) -> Schema {
        let offset =
            json_schema!({ "type": "string", "pattern": r"^-?[0-9]+(\.[0-9]+)? *(mm|cm|m|km)$" });
        json_schema!({ "type": "array", "items": offset, "minItems": 2, "maxItems": 2 })
    }
}

/// Bits a second.
#[derive(Clone, Copy, Debug)]
pub(crate) struct BitRate(pub(crate) u64);

impl Read for BitRate {
    fn read(node: &Node, reader: &mut Reader) -> Option<Self> {
        quantity(node, reader, units::bit_rate, units::BIT_RATE_HELP).map(Self)
    }

    fn schema(_: &mut SchemaGenerator) -> Schema {
        json_schema!({ "type": "string", "pattern": r"^[0-9]+(\.[0-9]+)? *(bit/s|kbit/s|Mbit/s)$" })
    }
}

/// A state of the life cycle, or `none`.
#[derive(Clone, Copy, Debug)]
pub(crate) struct StateWord(pub(crate) Option<LifecycleState>);

/// `alive` or `gone`.
#[derive(Clone, Copy, Debug)]
pub(crate) struct SeenWord(pub(crate) bool);

/// What becomes of components when their agent dies.
#[derive(Clone, Copy, Debug)]
pub(crate) struct StayWord(pub(crate) bool);

choices! {
    Cut { "both" => Self::Both, "out" => Self::Out, "in" => Self::In, }
    Blow {
        "kill" => Self::Kill,
        "term" => Self::Term,
        "stop" => Self::Stop,
        "continue" => Self::Continue,
    }
    StateWord {
        "created" => Self(Some(LifecycleState::Created)),
        "inactive" => Self(Some(LifecycleState::Inactive)),
        "active" => Self(Some(LifecycleState::Active)),
        "error" => Self(Some(LifecycleState::Error)),
        "none" => Self(None),
    }
    SeenWord { "alive" => Self(true), "gone" => Self(false), }
    StayWord { "keep" => Self(true), "stop" => Self(false), }
}

macro_rules! inline {
    ($($type:ty, $name:literal;)*) => {$(
        impl JsonSchema for $type {
            fn inline_schema() -> bool {
                true
            }

            fn schema_name() -> Cow<'static, str> {
                Cow::Borrowed($name)
            }

            fn json_schema(generator: &mut SchemaGenerator) -> Schema {
                <Self as Read>::schema(generator)
            }
        }
    )*};
}
inline! {
    Robots, "Robots";
    Place, "Place";
}
