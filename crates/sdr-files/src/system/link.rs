//! What executables say of themselves, held against a system.

use sdr_core::{
    record::{FleetValue, RECORD_BYTES_MAX},
    spec::{ComponentProfile, ComponentSpec, ParameterProfile, PortProfile, PortRef, Value},
};

use super::{ComponentPlaces, LoadedSystem};
use crate::{
    problem::{Mark, Problems},
    read::Reader,
};

/// Fills in the message types of all connections from what the executables say of
/// themselves, and refuses executables, ports and parameters that are not there.
///
/// Whole numbers given for parameters that are numbers become numbers. On problems the
/// system is not to be deployed.
pub fn link_profiles(
    system: &mut LoadedSystem,
    profiles: &[ComponentProfile],
) -> Result<(), Problems> {
    let mut reader = Reader::new(system.places.source.clone());
    for (component, places) in system.spec.components.iter_mut().zip(&system.places.components) {
        match profile_of(component, profiles) {
            Some(profile) => {
                link_parameters(component, places, profile, &mut reader);
                check_devices(component, places, profile, &mut reader);
            }
            None => missing(component, places, profiles, &mut reader),
        }
    }
    let components = &system.spec.components;
    for (connection, marks) in system.spec.connections.iter_mut().zip(&system.places.connections) {
        let from =
            port(&connection.from, End::Output, (components, profiles), (marks.0, &mut reader));
        let to = port(&connection.to, End::Input, (components, profiles), (marks.1, &mut reader));
        let (Some(from), Some(to)) = (from, to) else { continue };
        if from.message_type != to.message_type {
            let message = format!(
                "{} is {}, but {} takes {}",
                connection.from, from.message_type, connection.to, to.message_type
            );
            let help = String::from("allowed: the same type at both ends");
            reader.problem(marks.1, message, Some(help));
            continue;
        }
        connection.message_type.clone_from(&from.message_type);
        let size = FleetValue::Connection(connection.clone().into()).encode().len();
        if size > RECORD_BYTES_MAX {
            let message = format!("the connection takes {size} bytes on the mesh");
            let help = format!("allowed: at most {RECORD_BYTES_MAX}");
            reader.problem(marks.0, message, Some(help));
        }
    }
    reader.finish(Some(()))
}

fn profile_of<'p>(
    component: &ComponentSpec,
    profiles: &'p [ComponentProfile],
) -> Option<&'p ComponentProfile> {
    profiles.iter().find(|profile| profile.name == component.launch.name())
}

fn missing(
    component: &ComponentSpec,
    places: &ComponentPlaces,
    profiles: &[ComponentProfile],
    reader: &mut Reader,
) {
    let known: Vec<&str> = profiles.iter().map(|profile| profile.name.as_str()).collect();
    reader.unknown(places.run, "executable", component.launch.name(), &known);
}

fn link_parameters(
    component: &mut ComponentSpec,
    places: &ComponentPlaces,
    profile: &ComponentProfile,
    reader: &mut Reader,
) {
    let known: Vec<&str> =
        profile.parameters.iter().map(|parameter| parameter.name.as_str()).collect();
    for ((name, value), marks) in component.parameters.iter_mut().zip(&places.parameters) {
        let Some(parameter) = profile.parameters.iter().find(|other| other.name == *name) else {
            let what = format!("parameter of {}", profile.name);
            reader.unknown(marks.0, &what, name, &known);
            continue;
        };
        if let (Value::Float(_), Some(number)) = (&parameter.default, value.as_f64()) {
            *value = Value::Float(number);
        }
        if value.kind() != parameter.default.kind() {
            let message = format!(
                "parameter `{name}` is {}, found {}",
                parameter.default.kind(),
                value.kind()
            );
            let help = format!("allowed: such as {}, its default", parameter.default);
            reader.problem(marks.1, message, Some(help));
        } else if let Some(allowed) = out_of_range(value, parameter) {
            reader.problem(marks.1, format!("parameter `{name}` is {value}"), Some(allowed));
        }
    }
}

/// What is allowed instead of a value outside its range.
fn out_of_range(value: &Value, parameter: &ParameterProfile) -> Option<String> {
    let found = value.as_f64()?;
    let bar = |bar: &Option<Value>| bar.as_ref().and_then(Value::as_f64);
    let under = bar(&parameter.min).is_some_and(|least| found < least);
    let over = bar(&parameter.max).is_some_and(|greatest| found > greatest);
    (under || over).then(|| match (&parameter.min, &parameter.max) {
        (Some(min), Some(max)) => format!("allowed: {min} to {max}"),
        (Some(min), None) => format!("allowed: {min} or more"),
        (None, Some(max)) => format!("allowed: {max} or less"),
        (None, None) => String::from("allowed: its default"),
    })
}

/// A device that is not listed is not told to the component, wherever it runs.
fn check_devices(
    component: &ComponentSpec,
    places: &ComponentPlaces,
    profile: &ComponentProfile,
    reader: &mut Reader,
) {
    let changed = |word: &String| {
        let default = profile.parameters.iter().find(|known| known.name == *word);
        let given = component.parameters.iter().find(|(name, _)| name == word);
        given.is_some_and(|(_, value)| default.is_none_or(|known| known.default != *value))
    };
    for device in &profile.devices {
        let listed = component.devices.iter().any(|name| name.as_str() == device.name);
        if !listed && !device.unless.as_ref().is_some_and(changed) {
            let message = format!("{} needs the device `{}`", profile.name, device.name);
            let or = device.unless.as_ref().map(|word| format!(", or its parameter `{word}`"));
            let help = format!("add `devices: [{}]`{}", device.name, or.unwrap_or_default());
            reader.problem(places.run, message, Some(help));
        }
    }
}

/// Which end of a connection.
#[derive(Clone, Copy)]
enum End {
    Output,
    Input,
}

/// The port at one end. Executables that are missing were told before.
fn port<'p>(
    port: &PortRef,
    end: End,
    (components, profiles): (&[ComponentSpec], &'p [ComponentProfile]),
    (mark, reader): (Mark, &mut Reader),
) -> Option<&'p PortProfile> {
    let component = components.iter().find(|component| component.name == port.component)?;
    let profile = profile_of(component, profiles)?;
    let (ports, others, word, other) = match end {
        End::Output => (&profile.outputs, &profile.inputs, "output", "an input"),
        End::Input => (&profile.inputs, &profile.outputs, "input", "an output"),
    };
    if let Some(found) = ports.iter().find(|candidate| candidate.name == port.port) {
        return Some(found);
    }
    let names: Vec<&str> = ports.iter().map(|candidate| candidate.name.as_str()).collect();
    if names.is_empty() {
        let message = format!("{} has no {word}, and no `{}`", profile.name, port.port);
        reader.problem(mark, message, None);
    } else if others.iter().any(|candidate| candidate.name == port.port) {
        let message = format!("{port} is {other} of {}, not an {word}", profile.name);
        let help = format!("allowed: {}", names.join(", "));
        reader.problem(mark, message, Some(help));
    } else {
        reader.unknown(mark, &format!("{word} of {}", profile.name), port.port.as_str(), &names);
    }
    None
}
