//! Who this process is, as the agent said in the environment.

use std::env;
use std::path::PathBuf;
use std::time::Duration;

use sdr_core::{id::ComponentKey, input::InstanceId};

use crate::protocol::{
    ENV_COMPONENT, ENV_INSTANCE, ENV_ORPHAN_MS, ENV_SOCKET, parse_component_key,
};

/// Who this process is and where its agent listens.
#[derive(Clone, Debug)]
pub(super) struct Identity {
    pub(super) socket: PathBuf,
    pub(super) component: ComponentKey,
    pub(super) instance: InstanceId,
    /// How long to go on without an agent; `None` is for ever.
    pub(super) orphan: Option<Duration>,
}

impl Identity {
    pub(super) fn from_environment() -> Result<Self, String> {
        let text = |name: &str| {
            env::var(name).map_err(|_| format!("environment variable {name} is not set"))
        };
        let socket = PathBuf::from(text(ENV_SOCKET)?);
        let key = text(ENV_COMPONENT)?;
        let component = parse_component_key(&key)
            .map_err(|error| format!("{ENV_COMPONENT}=`{key}`: {error}"))?;
        let instance = number(ENV_INSTANCE, &text(ENV_INSTANCE)?)?;
        let orphan = match env::var(ENV_ORPHAN_MS) {
            Ok(ms) => Some(Duration::from_millis(number(ENV_ORPHAN_MS, &ms)?)),
            Err(_) => None,
        };
        Ok(Self { socket, component, instance, orphan })
    }
}

fn number(name: &str, text: &str) -> Result<u64, String> {
    text.parse().map_err(|_| format!("{name}=`{text}`; allowed: a whole number"))
}
