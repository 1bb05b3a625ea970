//! Connections of a system.

use sdr_core::{
    id::Name,
    spec::{ConnectionSpec, PARTS_MAX, PortRef, Qos, Reliability},
};

use super::file::ConnectionEntry;
use crate::{
    problem::Mark,
    read::{At, Reader},
};

/// Deepest queue of one connection.
const DEPTH_MAX: u8 = 64;

/// Connections, and the places of both ends.
pub(super) type Connections = (Vec<ConnectionSpec>, Vec<(Mark, Mark)>);

pub(super) fn connections(
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
