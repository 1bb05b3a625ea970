//! From a system as written to the checked one.

use std::time::Duration;

use sdr_core::{
    id::Name,
    record::{FleetValue, RECORD_BYTES_MAX},
    spec::{
        ComponentSpec, Execution, Isolation, IsolationAction, Launch, Needs, PARTS_MAX, Place,
        Standby, SystemSpec, Value,
    },
    units::{Bytes, Permille},
};

use super::{
    ComponentPlaces, LoadedSystem, SystemPlaces,
    connections::connections,
    file::{
        ComponentTable, DefaultsTable, NeedsTable, OnData, PlaceTable, Rate, StandbyTable,
        SystemFile,
    },
    limits::limits,
    order::{check_names, check_start_order},
    policies::{OwnRules, policies},
};
use crate::{
    policy::Finder,
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

/// The checked system; every problem is told to `reader`.
pub(super) fn checked(
    file: SystemFile,
    source: Source,
    finder: &Finder,
    reader: &mut Reader,
) -> Option<LoadedSystem> {
    let system = file.system.0;
    let At { value: Map(mut entries), mark } = file.components.0?;
    let own = own_recovery(&mut entries);
    let (allocation, recovery) =
        policies((file.allocation, file.recovery, own), (finder, system.as_ref()), reader);
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
        check_size(
            &FleetValue::Component(component.clone().into()),
            place.run,
            "component",
            reader,
        );
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

/// Rules that components have of their own, taken out of their tables.
fn own_recovery(entries: &mut [(At<String>, Option<At<ComponentTable>>)]) -> Vec<OwnRules> {
    let own = entries.iter_mut().filter_map(|(name, table)| {
        let entry = table.as_mut()?.value.recovery.take()?;
        Some((name.value.clone(), entry))
    });
    own.collect()
}

pub(super) fn check_size(value: &FleetValue, mark: Mark, what: &str, reader: &mut Reader) {
    let size = value.encode().len();
    if size > RECORD_BYTES_MAX {
        let message = format!("the {what} takes {size} bytes on the mesh");
        let help = format!("allowed: at most {RECORD_BYTES_MAX}; shorten names, lists, parameters");
        reader.problem(mark, message, Some(help));
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
    let limits = table.limits.map(|table| limits(table, reader)).unwrap_or_default();
    let (parameters, parameter_marks) = parameters(table.parameters, reader);
    let list = |given: Option<At<Vec<At<Name>>>>| -> Vec<Name> {
        given.map(|list| list.value.into_iter().map(|at| at.value).collect()).unwrap_or_default()
    };
    let place = table.place.map(|place| self::place(place, list)).unwrap_or_default();
    let run = table.run.0?;
    let executable_mark = run.value.mark;
    let launch =
        Launch::Native { executable: run.value.executable, arguments: run.value.arguments };
    let name = checked_name?;
    let places = ComponentPlaces { run: executable_mark, parameters: parameter_marks };
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
        on_agent_death: table.on_agent_death.map(|at| at.value),
        limits,
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
        apart: table.apart.map_or(usual.apart, |at| at.value),
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
