//! What the next agent must know of a process to go on with it.

use std::{path::PathBuf, sync::Arc};

use rand::TryRngCore as _;
use rand::rngs::OsRng;
use sdr_component::protocol::SharedMemory;
use sdr_core::{
    effect::{InputWiring, LaunchOrder},
    id::ComponentKey,
    input::InstanceId,
    record::{FleetValue, RecordKind},
    spec::ComponentSpec,
};
use serde::{Deserialize, Serialize};

/// Kept in the journal for one process.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub(super) struct Keepsake {
    /// Whose instance it is.
    pub(super) component: ComponentKey,
    /// The word that the process carries in its environment.
    pub(super) badge: String,
    /// Its spec as on the mesh, in hexadecimal digits: so it is read by versions before and
    /// after, and comes back exactly, floats too.
    spec: String,
    /// Its wired inputs.
    inputs: Vec<InputWiring>,
    /// How deep readers of its outputs go.
    output_depth: u8,
    /// The socket it knows.
    pub(super) socket: PathBuf,
    /// Where its samples lie.
    pub(super) memory: SharedMemory,
    /// Its log.
    pub(super) log: PathBuf,
    /// Length of the log before the process wrote to it.
    pub(super) log_begin: u64,
    /// Its control group, when it has one of its own.
    pub(super) cgroup: Option<PathBuf>,
}

/// What a process is started with beside its order.
#[derive(Clone, Debug)]
pub(super) struct Place {
    pub(super) badge: String,
    pub(super) socket: PathBuf,
    pub(super) memory: SharedMemory,
    pub(super) log: PathBuf,
    pub(super) log_begin: u64,
    pub(super) cgroup: Option<PathBuf>,
}

impl Keepsake {
    pub(super) fn new(order: &LaunchOrder, place: Place) -> Self {
        let Place { badge, socket, memory, log, log_begin, cgroup } = place;
        Self {
            component: order.component.clone(),
            badge,
            spec: hex(&FleetValue::Component(Arc::new(order.spec.clone())).encode()),
            inputs: order.inputs.clone(),
            output_depth: order.output_depth,
            socket,
            memory,
            log,
            log_begin,
            cgroup,
        }
    }

    /// The order that started it; `None` when a version wrote it that this one cannot read.
    pub(super) fn order(&self, instance: InstanceId) -> Option<LaunchOrder> {
        Some(LaunchOrder {
            instance,
            component: self.component.clone(),
            spec: self.spec()?,
            inputs: self.inputs.clone(),
            output_depth: self.output_depth,
        })
    }

    fn spec(&self) -> Option<ComponentSpec> {
        match FleetValue::decode(RecordKind::COMPONENT, &unhex(&self.spec)?) {
            Ok(FleetValue::Component(spec)) => Some(Arc::unwrap_or_clone(spec)),
            Ok(_) | Err(_) => None,
        }
    }
}

/// A new badge: 128 bits from the kernel.
pub(super) fn badge() -> String {
    let word = || OsRng.try_next_u64().expect("the kernel always has randomness after boot");
    format!("{:016x}{:016x}", word(), word())
}

fn hex(bytes: &[u8]) -> String {
    bytes.iter().map(|byte| format!("{byte:02x}")).collect()
}

fn unhex(text: &str) -> Option<Vec<u8>> {
    let digits = text.as_bytes().chunks(2);
    let byte = |pair: &[u8]| u8::from_str_radix(std::str::from_utf8(pair).ok()?, 16).ok();
    digits.map(byte).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::supervisor::tests::order;

    #[test]
    fn an_order_comes_back_exactly_from_the_journal() {
        let mut order = order(7, "lidar", vec!["--fast".into()], "good");
        let awkward = sdr_core::spec::Value::Float(0.1 + 0.2);
        order.spec.parameters.push(("score".into(), awkward));
        let place = Place {
            badge: badge(),
            socket: "/run/c.sock".into(),
            memory: SharedMemory { prefix: "p_".into(), root: "/dev/shm/p".into() },
            log: "/var/log/x".into(),
            log_begin: 12,
            cgroup: None,
        };
        let keepsake = Keepsake::new(&order, place);

        let text = serde_json::to_string(&keepsake).unwrap();
        let back: Keepsake = serde_json::from_str(&text).unwrap();

        assert_eq!(back, keepsake);
        assert_eq!(back.order(7), Some(order));
        assert_ne!(badge(), badge());
        assert_eq!(unhex("0g"), None);
    }
}
