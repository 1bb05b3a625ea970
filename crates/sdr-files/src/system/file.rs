//! A system as it is written.

use std::time::Duration;

use schemars::{Schema, SchemaGenerator, json_schema};
use sdr_core::{
    id::{Name, RobotId},
    spec::{IsolationAction, OnAgentDeath, Reliability, StandbyKind, StandbyWhere, Value},
    units::{Bytes, Permille},
};

use super::limits::LimitsTable;
use crate::{
    policy::{AllocationFile, PolicyEntry, RecoveryFile},
    problem::Mark,
    read::{At, Map, Need, Read, Reader, choices, one_key, quantity, table},
    tree::{Body, Node},
    units,
};

table! {
    /// A system: components, what connects them, and the policies that place and mend them.
    pub(crate) struct SystemFile {
        /// Its name; one system of that name runs in a fleet.
        system: Need<At<Name>>,
        /// How to place: the name of a policy, a path, or the policy itself; default `default`.
        allocation: Option<At<PolicyEntry<AllocationFile>>>,
        /// What to do in trouble: as `allocation`.
        recovery: Option<At<PolicyEntry<RecoveryFile>>>,
        /// For components that do not say otherwise.
        defaults: Option<DefaultsTable>,
        /// Components by name; first-fit takes them in this order.
        components: Need<At<Map<At<ComponentTable>>>>,
        /// Which output feeds which input: `a.out -> b.in`, or the long form.
        connections: Option<At<Vec<ConnectionEntry>>>,
    }
    later { for_each: "one copy on each robot", }
}

table! {
    /// For components that do not say otherwise.
    pub(crate) struct DefaultsTable {
        /// What a component is said to need.
        needs: Option<NeedsTable>,
        /// How often it is called; default 10Hz.
        rate: Option<At<Rate>>,
        /// on-data instead of a rate.
        execute: Option<At<OnData>>,
    }
}

table! {
    /// What a component is said to need; the larger of this and what is measured counts.
    pub(crate) struct NeedsTable {
        /// Memory while active.
        memory: Option<At<Bytes>>,
        /// CPU while active; 100% is one core.
        cpu: Option<At<Permille>>,
    }
}

table! {
    /// One component.
    pub(crate) struct ComponentTable {
        /// How its process is started.
        run: Need<At<RunEntry>>,
        /// What it is said to need.
        needs: Option<NeedsTable>,
        /// How often it is called.
        rate: Option<At<Rate>>,
        /// on-data: called when any input has a new sample.
        execute: Option<At<OnData>>,
        /// Parts of the body it must find on its robot.
        devices: Option<At<Vec<At<Name>>>>,
        /// It moves a body: emergency stops latch, isolation deactivates.
        actuator: Option<At<bool>>,
        /// Values for its parameters.
        parameters: Option<Map<At<Value>>>,
        /// Components that must be active before it is activated.
        after: Option<At<Vec<At<Name>>>>,
        /// Where it may run.
        place: Option<PlaceTable>,
        /// Wished standbys.
        standby: Option<StandbyTable>,
        /// What it does when its robot hears nobody.
        on_isolation: Option<At<IsolationEntry>>,
        /// Rules of its own in trouble: changes to those of the system, or the name of a policy.
        recovery: Option<At<PolicyEntry<RecoveryFile>>>,
        /// What becomes of it when its agent dies; default: as robot.toml has it.
        on_agent_death: Option<At<OnAgentDeath>>,
        /// What its process may take.
        limits: Option<LimitsTable>,
    }
    later {
        ports: "mapping ports to ROS 2 topics",
        ready: "waiting for foreign processes",
    }
}

table! {
    /// Where a component may run.
    pub(crate) struct PlaceTable {
        /// Only here.
        robot: Option<At<RobotId>>,
        /// Only on robots with all of these labels.
        labels: Option<At<Vec<String>>>,
        /// Not on the robot of any of these.
        apart_from: Option<At<Vec<At<Name>>>>,
        /// Only on the robot of these.
        together_with: Option<At<Vec<At<Name>>>>,
    }
}

table! {
    /// Wished standbys.
    pub(crate) struct StandbyTable {
        /// How many, 0 to 4; default 1.
        count: Option<At<u8>>,
        /// same-robot, other-robot or any (default).
        r#where: Option<At<StandbyWhere>>,
        /// hot (running, inactive; default) or cold (its place is reserved).
        kind: Option<At<StandbyKind>>,
        /// Time between two state checkpoints; default 1s.
        checkpoint: Option<At<Duration>>,
        /// Labels, or kinds of labels (`rack` for `rack=2`), that it must not share with its home.
        apart: Option<At<Vec<String>>>,
    }
}

table! {
    /// What a component does when its robot hears nobody.
    pub(crate) struct IsolationTable {
        /// continue or deactivate.
        r#do: At<IsolationAction>,
        /// How long nobody must have been heard; default 2s.
        after: Option<At<Duration>>,
    }
}

table! {
    /// A connection in its long form.
    pub(crate) struct ConnectionTable {
        /// The output, `component.port`.
        from: At<String>,
        /// The input, `component.port`.
        to: At<String>,
        /// reliable (default) or best-effort.
        qos: Option<At<Reliability>>,
        /// How many samples a slow reader may fall behind, 1 to 64; default 8.
        depth: Option<At<u8>>,
        /// Longest pause that is still fine.
        deadline: Option<At<Duration>>,
    }
    later {
        drop: "choosing which samples are lost",
        rate_max: "thinning",
        needs: "bandwidth and latency of a connection",
    }
}

/// A rate, kept as its period.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Rate(pub(crate) Duration);

impl Read for Rate {
    fn read(node: &Node, reader: &mut Reader) -> Option<Self> {
        quantity(node, reader, units::period, units::RATE_HELP).map(Self)
    }

    fn schema(_: &mut SchemaGenerator) -> Schema {
        json_schema!({ "type": "string", "pattern": r"^[0-9]+(\.[0-9]+)? *(mHz|Hz|kHz)$" })
    }
}

/// The word `on-data`.
#[derive(Clone, Copy, Debug)]
pub(crate) struct OnData;

/// How a process is started: `{ native: fisheye }` or `{ native: [fisheye, --flag] }`.
#[derive(Clone, Debug)]
pub(crate) struct RunEntry {
    pub(crate) executable: String,
    /// Where its name stands.
    pub(crate) mark: Mark,
    pub(crate) arguments: Vec<String>,
}

const RUN_LATER: &[(&str, &str)] = &[
    ("library", "shared libraries"),
    ("python", "Python modules"),
    ("ros2", "foreign ROS 2 nodes"),
    ("process", "foreign processes"),
    ("container", "containers"),
];

impl Read for RunEntry {
    fn read(node: &Node, reader: &mut Reader) -> Option<Self> {
        const ALLOWED: &str = "{ native: executable } or { native: [executable, argument] }";
        let Body::Table(entries) = &node.body else {
            reader.wrong(node, ALLOWED);
            return None;
        };
        let [(key, value)] = entries.as_slice() else {
            reader.wrong(node, &format!("exactly one key, {ALLOWED}"));
            return None;
        };
        if let Some((word, what)) = RUN_LATER.iter().find(|(word, _)| *word == key.word) {
            reader.later(key.mark, word, what);
            return None;
        }
        if key.word != "native" {
            reader.unknown(key.mark, "key", &key.word, &["native"]);
            return None;
        }
        let mut mark = value.mark;
        let mut words = match &value.body {
            Body::List(items) => {
                mark = items.first().map_or(mark, |first| first.mark);
                Vec::<String>::read(value, reader)?
            }
            Body::Nothing
            | Body::Bool(_)
            | Body::Int(_)
            | Body::Float(_)
            | Body::Text(_)
            | Body::Table(_) => vec![String::read(value, reader)?],
        };
        if words.is_empty() || words[0].contains('/') || words[0].starts_with('.') {
            reader.wrong(value, "a file name without folder, looked up in [components] path");
            return None;
        }
        let executable = words.remove(0);
        Some(Self { executable, mark, arguments: words })
    }

    fn schema(generator: &mut SchemaGenerator) -> Schema {
        let word = one_key::<String>("native", generator);
        json_schema!({ "anyOf": [word, one_key::<Vec<String>>("native", generator)] })
    }
}

/// `continue`, `deactivate`, or the long form.
#[derive(Clone, Debug)]
pub(crate) struct IsolationEntry {
    pub(crate) action: IsolationAction,
    pub(crate) after: Option<Duration>,
}

impl Read for IsolationEntry {
    fn read(node: &Node, reader: &mut Reader) -> Option<Self> {
        if matches!(node.body, Body::Table(_)) {
            let table = IsolationTable::read(node, reader)?;
            return Some(Self {
                action: table.r#do.value,
                after: table.after.map(|after| after.value),
            });
        }
        IsolationAction::read(node, reader).map(|action| Self { action, after: None })
    }

    fn schema(generator: &mut SchemaGenerator) -> Schema {
        let short = IsolationAction::schema(generator);
        json_schema!({ "anyOf": [short, IsolationTable::schema(generator)] })
    }
}

/// `a.out -> b.in`, or the long form, and where it stands.
#[derive(Clone, Debug)]
pub(crate) struct ConnectionEntry(pub(crate) At<ConnectionTable>);

impl Read for ConnectionEntry {
    fn read(node: &Node, reader: &mut Reader) -> Option<Self> {
        let Body::Text(text) = &node.body else {
            return At::read(node, reader).map(Self);
        };
        let Some((from, to)) = text.split_once("->") else {
            reader.wrong(node, "`component.port -> component.port`");
            return None;
        };
        let part = |word: &str| At { value: word.trim().to_owned(), mark: node.mark };
        let (from, to) = (part(from), part(to));
        let table = ConnectionTable { from, to, qos: None, depth: None, deadline: None };
        Some(Self(At { value: table, mark: node.mark }))
    }

    fn schema(generator: &mut SchemaGenerator) -> Schema {
        let long = ConnectionTable::schema(generator);
        json_schema!({ "anyOf": [{ "type": "string", "pattern": "->" }, long] })
    }
}

impl schemars::JsonSchema for ConnectionEntry {
    fn inline_schema() -> bool {
        true
    }

    fn schema_name() -> std::borrow::Cow<'static, str> {
        std::borrow::Cow::Borrowed("Connection")
    }

    fn json_schema(generator: &mut SchemaGenerator) -> Schema {
        Self::schema(generator)
    }
}

impl Read for Value {
    fn read(node: &Node, reader: &mut Reader) -> Option<Self> {
        match &node.body {
            Body::Bool(flag) => Some(Self::Bool(*flag)),
            Body::Int(number) => Some(Self::Int(*number)),
            Body::Float(number) if number.is_finite() => Some(Self::Float(*number)),
            Body::Text(text) if text.contains("{robot}") => {
                reader.later(node.mark, "{robot}", "the robot's name in parameters");
                None
            }
            Body::Text(text) => Some(Self::Text(text.clone())),
            Body::List(_) => Vec::read(node, reader).map(Self::List),
            Body::Float(_) | Body::Nothing | Body::Table(_) => {
                reader.wrong(node, "true, false, a number, text or a list of these");
                None
            }
        }
    }

    fn schema(_: &mut SchemaGenerator) -> Schema {
        json_schema!({ "type": ["boolean", "number", "string", "array"] })
    }
}

choices! {
    OnData { "on-data" => Self, }
    IsolationAction { "continue" => Self::Continue, "deactivate" => Self::Deactivate, }
    Reliability { "reliable" => Self::Reliable, "best-effort" => Self::BestEffort, }
    StandbyKind { "hot" => Self::Hot, "cold" => Self::Cold, }
    StandbyWhere {
        "same-robot" => Self::SameRobot,
        "other-robot" => Self::OtherRobot,
        "any" => Self::Any,
    }
}
