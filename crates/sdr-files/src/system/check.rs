//! From a system as written to the checked one.

use std::time::Duration;

use sdr_core::{
    id::Name,
    record::{FleetValue, RECORD_BYTES_MAX},
    spec::{
        ComponentSpec, ConnectionSpec, Execution, Isolation, IsolationAction, Launch, Needs,
        PARTS_MAX, Place, PolicyBytes, PortRef, Qos, Reliability, Standby, SystemSpec, Value,
    },
    units::{Bytes, Permille},
};
use sdr_recovery::{Bar, Level, Trigger};

use super::{
    ComponentPlaces, LoadedSystem, SystemPlaces,
    circle::circle,
    file::{
        ComponentTable, ConnectionEntry, DefaultsTable, NeedsTable, OnData, PlaceTable, Rate,
        StandbyTable, SystemFile,
    },
};
use crate::{
    policy::{AllocationFile, Finder, PolicyEntry, PolicyFile, RecoveryFile},
    problem::{Mark, Source},
    read::{At, Map, Reader},
};

/// The rate of components that give none: 10 Hz.
const PERIOD: Duration = Duration::from_millis(100);
/// How long a robot hears nobody before that counts, unless the file says otherwise: some
/// rounds of gossip.
const ISOLATED_AFTER: Duration = Duration::from_secs(2);
/// Most standbys of one component.
const STANDBYS_MAX: u8 = 4;
/// Deepest queue of one connection.
const DEPTH_MAX: u8 = 64;

/// The checked system; every problem is told to `reader`.
pub(super) fn checked(
    file: SystemFile,
    source: Source,
    finder: &Finder,
    reader: &mut Reader,
) -> Option<LoadedSystem> {
    let system = file.system.0;
    let (allocation, recovery) =
        policies(file.allocation, file.recovery, (finder, system.as_ref()), reader);
    let At { value: Map(entries), mark } = file.components.0?;
    if entries.is_empty() {
        reader.problem(mark, "a system has at least one component", None);
    }
    if entries.len() > PARTS_MAX {
        let message = format!("{} components", entries.len());
        let help = format!("allowed: at most {PARTS_MAX}");
        reader.problem(mark, message, Some(help));
        return None;
    }
    let names: Vec<&str> = entries.iter().map(|(name, _)| name.value.as_str()).collect();
    check_names(&entries, &names, reader);
    check_start_order(&entries, reader);
    let connections = connections(file.connections, &names, reader);
    let defaults = Defaults::of(file.defaults, reader);
    let mut places = SystemPlaces { source, components: Vec::new(), connections: connections.1 };
    let mut components = Vec::new();
    for (name, table) in entries {
        let made = component(name, table, &defaults, reader);
        let Some((mut component, place)) = made else { continue };
        component.index = u16::try_from(components.len()).unwrap_or(u16::MAX);
        check_size(&FleetValue::Component(component.clone()), place.run, "component", reader);
        components.push(component);
        places.components.push(place);
    }
    let system = system?;
    let spec = SystemSpec {
        name: system.value,
        components,
        connections: connections.0,
        allocation,
        recovery,
    };
    if !reader.is_clean() {
        return None;
    }
    if let Err(error) = spec.check() {
        reader.problem(system.mark, error.to_string(), None);
    }
    Some(LoadedSystem { spec, places })
}

type Named<F> = Option<At<PolicyEntry<F>>>;

fn policies(
    allocation: Named<AllocationFile>,
    recovery: Named<RecoveryFile>,
    (finder, system): (&Finder, Option<&At<Name>>),
    reader: &mut Reader,
) -> (PolicyBytes, PolicyBytes) {
    let (name, own) = system.map_or(("system", Mark::FILE), |at| (at.value.as_str(), at.mark));
    let mark = allocation.as_ref().map_or(own, |entry| entry.mark);
    let recovery_mark = recovery.as_ref().map_or(own, |entry| entry.mark);
    let allocation = match allocation {
        Some(entry) => finder.entry(entry, name, reader),
        None => Some(AllocationFile::standard()),
    };
    let recovery = match recovery {
        Some(entry) => finder.entry(entry, name, reader),
        None => Some(RecoveryFile::standard()),
    };
    if let (Some(allocation), Some(recovery)) = (&allocation, &recovery) {
        check_bars(allocation, recovery, mark, reader);
    }
    let allocation = allocation.map(|policy| policy.encode()).unwrap_or_default();
    let recovery = recovery.map(|policy| policy.encode()).unwrap_or_default();
    check_size(&FleetValue::Allocation(allocation.clone()), mark, "allocation policy", reader);
    check_size(&FleetValue::Recovery(recovery.clone()), recovery_mark, "recovery policy", reader);
    (allocation, recovery)
}

/// A home that allocation may choose must not be in trouble at once by recovery's bar.
fn check_bars(
    allocation: &sdr_alloc::Policy,
    recovery: &sdr_recovery::Policy,
    mark: Mark,
    reader: &mut Reader,
) {
    let fault = recovery.parts().rules.iter().find_map(|rule| match rule.trigger {
        Trigger::Condition(condition) => match condition.bar {
            Bar::AtMost(Level::Memory(bytes)) => Some(bytes),
            Bar::AtMost(Level::Share(_) | Level::Signal(_) | Level::Time(_)) | Bar::AtLeast(_) => {
                None
            }
        },
        Trigger::Fault => None,
    });
    let (tier, bars) = match &allocation.relaxed {
        Some(relaxed) => ("relaxed", relaxed),
        None => ("first", &allocation.strict),
    };
    if let (Some(fault), Some(home)) = (fault, bars.memory_free_at_least)
        && home <= fault
    {
        let message = format!(
            "allocation `{}` ({tier} tier) fills robots to {home} free, where recovery `{}` sees memory-short (at most {fault})",
            allocation.name,
            recovery.parts().name,
        );
        let help = format!("allowed: memory_free at_least more than {fault}");
        reader.problem(mark, message, Some(help));
    }
}

fn check_size(value: &FleetValue, mark: Mark, what: &str, reader: &mut Reader) {
    let size = value.encode().len();
    if size > RECORD_BYTES_MAX {
        let message = format!("the {what} takes {size} bytes on the mesh");
        let help = format!("allowed: at most {RECORD_BYTES_MAX}; shorten names, lists, parameters");
        reader.problem(mark, message, Some(help));
    }
}

type Entries = [(At<String>, Option<At<ComponentTable>>)];

/// Names that a component gives of others are there, and not its own.
fn check_names(entries: &Entries, names: &[&str], reader: &mut Reader) {
    for (own, table) in entries {
        let Some(table) = table else { continue };
        let place = table.value.place.as_ref();
        let lists = [
            ("after", table.value.after.as_ref()),
            ("apart_from", place.and_then(|place| place.apart_from.as_ref())),
            ("together_with", place.and_then(|place| place.together_with.as_ref())),
        ];
        for (key, list) in lists {
            for name in list.map(|list| list.value.as_slice()).unwrap_or_default() {
                if name.value.as_str() == own.value {
                    let message = format!("`{}` names itself in `{key}`", own.value);
                    reader.problem(name.mark, message, None);
                } else if !names.contains(&name.value.as_str()) {
                    reader.unknown(name.mark, "component", name.value.as_str(), names);
                }
            }
        }
    }
}

fn check_start_order(entries: &Entries, reader: &mut Reader) {
    let order: Vec<(Name, Vec<Name>)> = entries
        .iter()
        .filter_map(|(name, table)| {
            let after = table.as_ref()?.value.after.as_ref();
            let after = after.map(|list| list.value.iter().map(|at| at.value.clone()).collect());
            Some((Name::new(&name.value).ok()?, after.unwrap_or_default()))
        })
        .collect();
    let Some(circle) = circle(&order) else { return };
    let words: Vec<&str> = circle.iter().map(Name::as_str).collect();
    let place = entries.iter().find(|(name, _)| name.value == words[0]).and_then(|(_, table)| {
        let after = table.as_ref()?.value.after.as_ref()?;
        after.value.iter().find(|at| at.value == circle[1]).map(|at| at.mark)
    });
    // A name of its own in `after` was told before.
    if words.len() > 2 {
        let message = format!("the start order goes round in a circle: {}", words.join(" after "));
        reader.problem(place.unwrap_or(Mark::FILE), message, None);
    }
}

/// What components take that do not say otherwise.
struct Defaults {
    needs: Needs,
    execution: Execution,
}

impl Defaults {
    fn of(table: Option<DefaultsTable>, reader: &mut Reader) -> Self {
        let usual = Execution::Periodic { period: PERIOD };
        let none = Needs { memory: Bytes(0), cpu: Permille(0) };
        let Some(table) = table else { return Self { needs: none, execution: usual } };
        let execution = execution(table.rate, table.execute, reader).unwrap_or(usual);
        Self { needs: needs(table.needs, none), execution }
    }
}

fn needs(table: Option<NeedsTable>, default: Needs) -> Needs {
    let (memory, cpu) = table.map_or((None, None), |table| (table.memory, table.cpu));
    Needs {
        memory: memory.map_or(default.memory, |at| at.value),
        cpu: cpu.map_or(default.cpu, |at| at.value),
    }
}

fn execution(
    rate: Option<At<Rate>>,
    execute: Option<At<OnData>>,
    reader: &mut Reader,
) -> Option<Execution> {
    match (rate, execute) {
        (Some(_), Some(execute)) => {
            let help = String::from("allowed: one of them");
            reader.problem(execute.mark, "both `rate` and `execute: on-data`", Some(help));
            None
        }
        (Some(rate), None) => Some(Execution::Periodic { period: rate.value.0 }),
        (None, Some(_)) => Some(Execution::OnData),
        (None, None) => None,
    }
}

fn component(
    name: At<String>,
    table: Option<At<ComponentTable>>,
    defaults: &Defaults,
    reader: &mut Reader,
) -> Option<(ComponentSpec, ComponentPlaces)> {
    let checked_name = Name::new(&name.value)
        .map_err(|error| reader.problem(name.mark, error.to_string(), None))
        .ok();
    let table = table?.value;
    let actuator = table.actuator.is_some_and(|at| at.value);
    let execution = execution(table.rate, table.execute, reader).unwrap_or(defaults.execution);
    let standby = table.standby.map(|table| standby(table, reader)).unwrap_or_default();
    let action = if actuator { IsolationAction::Deactivate } else { IsolationAction::Continue };
    let mut on_isolation = Isolation { action, after: ISOLATED_AFTER };
    if let Some(given) = table.on_isolation {
        on_isolation.action = given.value.action;
        on_isolation.after = given.value.after.unwrap_or(ISOLATED_AFTER);
    }
    let (parameters, parameter_marks) = parameters(table.parameters, reader);
    let list = |given: Option<At<Vec<At<Name>>>>| -> Vec<Name> {
        given.map(|list| list.value.into_iter().map(|at| at.value).collect()).unwrap_or_default()
    };
    let place = table.place.map(|place| self::place(place, list)).unwrap_or_default();
    let run = table.run.0?;
    let launch =
        Launch::Native { executable: run.value.executable, arguments: run.value.arguments };
    let name = checked_name?;
    let places = ComponentPlaces { name: name.clone(), run: run.mark, parameters: parameter_marks };
    let component = ComponentSpec {
        name,
        index: 0,
        launch,
        needs: needs(table.needs, defaults.needs),
        execution,
        devices: list(table.devices),
        place,
        after: list(table.after),
        actuator,
        on_isolation,
        standby,
        parameters,
    };
    Some((component, places))
}

fn place(table: PlaceTable, list: impl Fn(Option<At<Vec<At<Name>>>>) -> Vec<Name>) -> Place {
    Place {
        robot: table.robot.map(|at| at.value),
        labels: table.labels.map(|at| at.value).unwrap_or_default(),
        apart_from: list(table.apart_from),
        together_with: list(table.together_with),
    }
}

fn standby(table: StandbyTable, reader: &mut Reader) -> Standby {
    let usual = Standby::default();
    if let Some(count) = &table.count
        && count.value > STANDBYS_MAX
    {
        let message = format!("{} standbys", count.value);
        reader.problem(count.mark, message, Some(format!("allowed: 0 to {STANDBYS_MAX}")));
    }
    Standby {
        count: table.count.map_or(1, |at| at.value),
        place: table.r#where.map_or(usual.place, |at| at.value),
        kind: table.kind.map_or(usual.kind, |at| at.value),
        checkpoint: table.checkpoint.map_or(usual.checkpoint, |at| at.value),
    }
}

/// Names with values, and the places of both.
type Parameters = (Vec<(String, Value)>, Vec<(Mark, Mark)>);

fn parameters(given: Option<Map<At<Value>>>, reader: &mut Reader) -> Parameters {
    let mut parameters = (Vec::new(), Vec::new());
    for (name, value) in given.map(|map| map.0).unwrap_or_default() {
        if let Err(error) = Name::new(&name.value) {
            reader.problem(name.mark, error.to_string(), None);
        }
        let Some(value) = value else { continue };
        parameters.1.push((name.mark, value.mark));
        parameters.0.push((name.value, value.value));
    }
    parameters
}

/// Connections, and the places of both ends.
type Connections = (Vec<ConnectionSpec>, Vec<(Mark, Mark)>);

fn connections(
    given: Option<At<Vec<ConnectionEntry>>>,
    names: &[&str],
    reader: &mut Reader,
) -> Connections {
    let mut made: Connections = (Vec::new(), Vec::new());
    let Some(given) = given else { return made };
    if given.value.len() > PARTS_MAX {
        let message = format!("{} connections", given.value.len());
        reader.problem(given.mark, message, Some(format!("allowed: at most {PARTS_MAX}")));
        return made;
    }
    for ConnectionEntry(entry) in given.value {
        let table = entry.value;
        let from = port(&table.from, names, reader);
        let to = port(&table.to, names, reader);
        if let Some(depth) = &table.depth
            && !(1..=DEPTH_MAX).contains(&depth.value)
        {
            let message = format!("depth {}", depth.value);
            reader.problem(depth.mark, message, Some(format!("allowed: 1 to {DEPTH_MAX}")));
        }
        let (Some(from), Some(to)) = (from, to) else { continue };
        if made.0.iter().any(|other| other.from == from && other.to == to) {
            let message = format!("connection {from} -> {to} is there twice");
            reader.problem(entry.mark, message, None);
            continue;
        }
        let usual = Qos::default();
        let qos = Qos {
            reliability: table.qos.map_or(Reliability::Reliable, |at| at.value),
            depth: table.depth.map_or(usual.depth, |at| at.value),
            deadline: table.deadline.map(|at| at.value),
        };
        let index = u16::try_from(made.0.len()).unwrap_or(u16::MAX);
        made.0.push(ConnectionSpec { index, from, to, message_type: String::new(), qos });
        made.1.push((table.from.mark, table.to.mark));
    }
    made
}

/// `component.port` with a component of this system.
fn port(at: &At<String>, names: &[&str], reader: &mut Reader) -> Option<PortRef> {
    let Some((component, port)) = at.value.split_once('.') else {
        let message = format!("`{}` is no port", at.value);
        reader.problem(at.mark, message, Some(String::from("allowed: component.port")));
        return None;
    };
    let mut name = |word: &str| {
        Name::new(word).map_err(|error| reader.problem(at.mark, error.to_string(), None)).ok()
    };
    let port = PortRef { component: name(component)?, port: name(port)? };
    if !names.contains(&component) {
        reader.unknown(at.mark, "component", component, names);
        return None;
    }
    Some(port)
}
