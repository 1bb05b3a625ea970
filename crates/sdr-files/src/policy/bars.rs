//! Bars and assumptions of allocation policies.

use std::time::Duration;

use schemars::{Schema, SchemaGenerator, json_schema};
use sdr_alloc::{IfUnknown, Millimetres, Weight};
use sdr_core::units::{Dbm, Permille};

use crate::{
    read::{Keys, Read, Reader, one_key, quantity},
    tree::{Body, Node},
    units::{self, UnitError},
};

/// `none`, or a bar with one key.
macro_rules! edges {
    ($($(#[$meta:meta])* $name:ident $key:literal;)*) => {$(
        $(#[$meta])*
        #[derive(Clone, Debug)]
        pub(crate) struct $name<T>(pub(crate) Option<T>);

        impl<T: Read> Read for $name<T> {
            fn read(node: &Node, reader: &mut Reader) -> Option<Self> {
                if is_none(node) {
                    return Some(Self(None));
                }
                let mut keys = Keys::of(node, reader)?;
                let value = keys.take::<T>($key, reader);
                keys.finish(&[], reader);
                value.map(|value| Self(Some(value)))
            }

            fn schema(generator: &mut SchemaGenerator) -> Schema {
                json_schema!({ "anyOf": [{ "const": "none" }, one_key::<T>($key, generator)] })
            }
        }
    )*};
}
edges! {
    /// `{ at_most: ... }`; `None` takes the bar away.
    AtMost "at_most";
    /// `{ at_least: ... }`; `None` takes the bar away.
    AtLeast "at_least";
}

/// The bar on charge: `{ at_least: 30%, if_needs_cpu: 50% }`.
#[derive(Clone, Debug)]
pub(crate) struct BatteryEntry(pub(crate) Option<sdr_alloc::BatteryBar>);

impl Read for BatteryEntry {
    fn read(node: &Node, reader: &mut Reader) -> Option<Self> {
        if is_none(node) {
            return Some(Self(None));
        }
        let mut keys = Keys::of(node, reader)?;
        let at_least = keys.take("at_least", reader);
        let if_needs_cpu: Option<Option<Permille>> = keys.take("if_needs_cpu", reader);
        keys.finish(&[], reader);
        let bar = sdr_alloc::BatteryBar { at_least: at_least?, if_needs_cpu: if_needs_cpu? };
        Some(Self(Some(bar)))
    }

    fn schema(generator: &mut SchemaGenerator) -> Schema {
        let share = Permille::schema(generator);
        json_schema!({ "anyOf": [{ "const": "none" }, {
            "type": "object",
            "properties": { "at_least": share.clone(), "if_needs_cpu": share },
            "required": ["at_least"],
            "additionalProperties": false,
        }] })
    }
}

fn is_none(node: &Node) -> bool {
    matches!(&node.body, Body::Text(word) if word == "none")
}

impl Read for Millimetres {
    fn read(node: &Node, reader: &mut Reader) -> Option<Self> {
        quantity(node, reader, millimetres, units::DISTANCE_HELP)
    }

    fn schema(_: &mut SchemaGenerator) -> Schema {
        json_schema!({ "type": "string", "pattern": r"^[0-9]+(\.[0-9]+)? *(mm|cm|m|km)$" })
    }
}

fn millimetres(text: &str) -> Result<Millimetres, UnitError> {
    units::distance_mm(text).map(Millimetres)
}

/// A weight: 0 to 1000, to a thousandth.
impl Read for Weight {
    #[expect(
        clippy::cast_possible_truncation,
        clippy::cast_sign_loss,
        reason = "the range was checked in the line before"
    )]
    fn read(node: &Node, reader: &mut Reader) -> Option<Self> {
        let number = f64::read(node, reader)?;
        let thousandths = (number * 1000.0).round();
        if !(0.0..=f64::from(Self::MAX.0)).contains(&thousandths) {
            reader.wrong(node, "a weight from 0 to 1000");
            return None;
        }
        Some(Self(thousandths as u32))
    }

    fn schema(_: &mut SchemaGenerator) -> Schema {
        json_schema!({ "type": "number", "minimum": 0, "maximum": 1000 })
    }
}

/// What an unknown fact counts as: `refuse`, `worst` or `assume VALUE`.
fn if_unknown<T>(
    node: &Node,
    reader: &mut Reader,
    parse: fn(&str) -> Result<T, UnitError>,
    allowed: &str,
) -> Option<IfUnknown<T>> {
    let allowed = format!("refuse, worst, assume VALUE with {allowed}");
    let text = reader.text(node, &allowed)?;
    match text.split_once(' ') {
        None if text == "refuse" => Some(IfUnknown::Refuse),
        None if text == "worst" => Some(IfUnknown::Worst),
        Some(("assume", value)) => match parse(value.trim()) {
            Ok(value) => Some(IfUnknown::Assume(value)),
            Err(error) => {
                let help = format!("allowed: {allowed}");
                reader.problem(node.mark, error.to_string(), Some(help));
                None
            }
        },
        None | Some(_) => {
            reader.wrong(node, &allowed);
            None
        }
    }
}

macro_rules! unknowns {
    ($($type:ty, $parse:path, $help:path;)*) => {$(
        impl Read for IfUnknown<$type> {
            fn read(node: &Node, reader: &mut Reader) -> Option<Self> {
                if_unknown(node, reader, $parse, $help)
            }

            fn schema(_: &mut SchemaGenerator) -> Schema {
                json_schema!({ "type": "string", "pattern": "^(refuse|worst|assume .+)$" })
            }
        }
    )*};
}
unknowns! {
    Permille, units::share, units::SHARE_HELP;
    Dbm, units::level, units::LEVEL_HELP;
    Duration, units::duration, units::DURATION_HELP;
    Millimetres, millimetres, units::DISTANCE_HELP;
}

/// `refuse` or `worst`, for facts that have no line of their own.
#[derive(Clone, Copy, Debug)]
pub(crate) enum UnknownElse {
    Refuse,
    Worst,
}

crate::read::choices! {
    UnknownElse { "refuse" => Self::Refuse, "worst" => Self::Worst, }
}
