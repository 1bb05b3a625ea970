//! Where a sensor's figure comes from: one word or a table with one key.

use std::path::PathBuf;

use schemars::{Schema, SchemaGenerator, json_schema};

use super::config::SystemPort;
use crate::{
    read::{At, Read, Reader, one_key},
    tree::{Body, Key, Node},
};

/// Where the radio level comes from.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum RssiSource {
    /// /proc/net/wireless of the interface.
    Auto,
    /// A file in the format of /proc/net/wireless.
    File(PathBuf),
}

/// Where the battery's charge comes from.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum BatterySource {
    /// A name below /sys/class/power_supply.
    PowerSupply(String),
    /// A file whose first word is the charge in per cent.
    File(PathBuf),
    /// A port with `sensor_msgs/msg/BatteryState`.
    Port(SystemPort),
}

/// Where the position comes from.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum PositionSource {
    /// A file with x, y and z in metres.
    File(PathBuf),
    /// A port with `nav_msgs/msg/Odometry`.
    Port(SystemPort),
}

/// A table with exactly one key, such as `{ file = "..." }`.
fn single<'n>(node: &'n Node, reader: &mut Reader, allowed: &str) -> Option<(&'n Key, &'n Node)> {
    if let Body::Table(entries) = &node.body
        && let [(key, value)] = entries.as_slice()
    {
        return Some((key, value));
    }
    reader.wrong(node, allowed);
    None
}

/// [`RssiSource`] as it stands in the file.
#[derive(Clone, Debug)]
pub(crate) enum RssiEntry {
    Auto,
    File(String),
}

impl Read for RssiEntry {
    fn read(node: &Node, reader: &mut Reader) -> Option<Self> {
        const ALLOWED: &str = "\"auto\", { file = \"...\" }";
        if let Body::Text(word) = &node.body {
            if word == "auto" {
                return Some(Self::Auto);
            }
            reader.wrong(node, ALLOWED);
            return None;
        }
        let (key, value) = single(node, reader, ALLOWED)?;
        if key.word == "file" {
            return String::read(value, reader).map(Self::File);
        }
        reader.unknown(key.mark, "key", &key.word, &["file"]);
        None
    }

    fn schema(generator: &mut SchemaGenerator) -> Schema {
        json_schema!({ "anyOf": [{ "const": "auto" }, one_key::<String>("file", generator)] })
    }
}

/// [`BatterySource`] and [`PositionSource`] as they stand in the file.
#[derive(Clone, Debug)]
pub(crate) enum SensorEntry {
    PowerSupply(String),
    File(String),
    Port(At<String>),
}

/// [`BatterySource`] as it stands in the file.
#[derive(Clone, Debug)]
pub(crate) struct BatteryEntry(pub(crate) SensorEntry);

/// [`PositionSource`] as it stands in the file.
#[derive(Clone, Debug)]
pub(crate) struct PositionEntry(pub(crate) SensorEntry);

fn sensor(node: &Node, reader: &mut Reader, words: &[&str]) -> Option<SensorEntry> {
    if let Body::Table(entries) = &node.body
        && let Some((key, _)) = entries.iter().find(|(key, _)| key.word == "ros")
    {
        reader.later(key.mark, "ros", "a figure from a ROS 2 topic");
        return None;
    }
    let allowed = words.iter().map(|word| format!("{{ {word} = \"...\" }}")).collect::<Vec<_>>();
    let (key, value) = single(node, reader, &allowed.join(", "))?;
    match key.word.as_str() {
        "power_supply" if words.contains(&"power_supply") => {
            String::read(value, reader).map(SensorEntry::PowerSupply)
        }
        "file" => String::read(value, reader).map(SensorEntry::File),
        "port" => At::read(value, reader).map(SensorEntry::Port),
        "snmp" => {
            reader.later(key.mark, "snmp", "a figure from an SNMP device");
            None
        }
        word => {
            reader.unknown(key.mark, "key", word, words);
            None
        }
    }
}

const BATTERY_WORDS: &[&str] = &["power_supply", "file", "port"];
const POSITION_WORDS: &[&str] = &["file", "port"];

impl Read for BatteryEntry {
    fn read(node: &Node, reader: &mut Reader) -> Option<Self> {
        sensor(node, reader, BATTERY_WORDS).map(Self)
    }

    fn schema(generator: &mut SchemaGenerator) -> Schema {
        sensor_schema(BATTERY_WORDS, generator)
    }
}

impl Read for PositionEntry {
    fn read(node: &Node, reader: &mut Reader) -> Option<Self> {
        sensor(node, reader, POSITION_WORDS).map(Self)
    }

    fn schema(generator: &mut SchemaGenerator) -> Schema {
        sensor_schema(POSITION_WORDS, generator)
    }
}

fn sensor_schema(words: &[&str], generator: &mut SchemaGenerator) -> Schema {
    let forms: Vec<Schema> = words.iter().map(|word| one_key::<String>(word, generator)).collect();
    json_schema!({ "anyOf": forms })
}
