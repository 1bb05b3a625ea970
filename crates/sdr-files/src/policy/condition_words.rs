//! Words of a rule's condition.

use std::time::Duration;

use schemars::{Schema, SchemaGenerator, json_schema};
use sdr_recovery::Over;

use crate::{
    read::{Read, Reader, choices},
    tree::{Body, Node},
    units,
};

/// A level whose unit depends on the fact.
#[derive(Clone, Debug)]
pub(crate) struct LevelText(pub(crate) String);

impl Read for LevelText {
    fn read(node: &Node, reader: &mut Reader) -> Option<Self> {
        match &node.body {
            Body::Text(text) => Some(Self(text.clone())),
            Body::Int(number) => Some(Self(number.to_string())),
            Body::Float(number) => Some(Self(number.to_string())),
            Body::Nothing | Body::Bool(_) | Body::List(_) | Body::Table(_) => {
                reader.wrong(node, "a level such as 200MB, 95%, -80dBm, 200ms or `3 per 1min`");
                None
            }
        }
    }

    fn schema(_: &mut SchemaGenerator) -> Schema {
        json_schema!({ "type": "string", "pattern": "^-?[0-9]" })
    }
}

/// `200MB for 5s`: a level and a time.
#[derive(Clone, Debug)]
pub(crate) struct ClearText {
    pub(super) level: String,
    pub(super) hold: Duration,
}

impl Read for ClearText {
    fn read(node: &Node, reader: &mut Reader) -> Option<Self> {
        let LevelText(text) = LevelText::read(node, reader)?;
        let Some((level, hold)) = text.split_once(" for ") else {
            return Some(Self { level: text, hold: Duration::ZERO });
        };
        match units::duration(hold.trim()) {
            Ok(hold) => Some(Self { level: level.trim().to_owned(), hold }),
            Err(error) => {
                let help = String::from("allowed: a level and a time such as 200MB for 5s");
                reader.problem(node.mark, error.to_string(), Some(help));
                None
            }
        }
    }

    fn schema(_: &mut SchemaGenerator) -> Schema {
        json_schema!({ "type": ["string", "integer"], "pattern": "^-?[0-9].*$" })
    }
}

/// A time, or a number of a component's periods.
#[derive(Clone, Copy, Debug)]
pub(crate) enum HoldTime {
    Time(Duration),
    Periods(u16),
}

impl Read for HoldTime {
    fn read(node: &Node, reader: &mut Reader) -> Option<Self> {
        if let Body::Text(text) = &node.body
            && let Some(number) = text.strip_suffix(" periods")
        {
            let periods = number.trim().parse().ok().filter(|periods| *periods > 0);
            if periods.is_none() {
                reader.wrong(node, "1 to 65535 periods");
            }
            return periods.map(Self::Periods);
        }
        Duration::read(node, reader).map(Self::Time)
    }

    fn schema(generator: &mut SchemaGenerator) -> Schema {
        let periods = json_schema!({ "type": "string", "pattern": "^[0-9]+ periods$" });
        json_schema!({ "anyOf": [Duration::schema(generator), periods] })
    }
}

/// What a component's CPU is compared to.
#[derive(Clone, Copy, Debug)]
pub(crate) enum CpuOf {
    Limit,
    Core,
}

choices! {
    CpuOf { "limit" => Self::Limit, "core" => Self::Core, }
    Over { "median" => Self::Median, "worst" => Self::Worst, "best" => Self::Best, }
}
