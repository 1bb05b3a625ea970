//! Who this process is, as the agent said in the environment.

use std::env;
use std::path::PathBuf;
use std::time::Duration;

use sdr_core::{id::ComponentKey, input::InstanceId};

use crate::protocol::{
    ENV_BADGE, ENV_COMPONENT, ENV_INSTANCE, ENV_LEASE_MS, ENV_ORPHAN_MS, ENV_SOCKET,
    parse_component_key,
};

/// Who this process is and where its agent listens.
#[derive(Clone, Debug)]
pub(super) struct Identity {
    pub(super) socket: PathBuf,
    pub(super) component: ComponentKey,
    pub(super) instance: InstanceId,
    /// How long to go on without an agent; `None` is for ever.
    pub(super) orphan: Option<Duration>,
    /// How long to stay active without an agent; `None` is for ever.
    pub(super) lease: Option<Duration>,
    /// By which a later agent knows this process again.
    pub(super) badge: Option<String>,
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
        let (orphan, lease) = (time(ENV_ORPHAN_MS)?, time(ENV_LEASE_MS)?);
        let badge = env::var(ENV_BADGE).ok();
        Ok(Self { socket, component, instance, orphan, lease, badge })
    }
}

fn time(name: &str) -> Result<Option<Duration>, String> {
    let given = env::var(name).ok();
    given.map(|ms| number(name, &ms).map(Duration::from_millis)).transpose()
}

fn number(name: &str, text: &str) -> Result<u64, String> {
    text.parse().map_err(|_| format!("{name}=`{text}`; allowed: a whole number"))
}
