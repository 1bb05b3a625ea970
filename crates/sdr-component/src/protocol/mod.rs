//! What agent and component say to each other: one JSON object a line on a Unix socket.
//!
//! ```text
//!   component                                   agent
//!   hello {v, component, instance, pid, profile, now}  ──▶
//!        ◀──  configure {parameters, devices, inputs, memory, execution, ..}   (state created)
//!   on_initialize
//!   state {inactive}                                   ──▶
//!        ◀──  command {activate, token}
//!   state {active, token}                              ──▶
//!   beat, counters, heard ..                           ──▶
//!        ◀──  command {deactivate | reset | finish}
//! ```
//!
//! `docs/protocol.md` says the same with examples, for components in other languages. Unknown
//! fields are ignored, unknown types of message are answered by `error` and the connection is
//! closed, so version 2 can add fields freely.

mod line;

use std::collections::BTreeMap;
use std::path::PathBuf;
use std::time::Duration;

use serde::{Deserialize, Serialize};

use sdr_core::{
    effect::InputWiring,
    id::{ComponentKey, Name, RobotId},
    input::InstanceId,
    lifecycle::LifecycleState,
    order::Token,
    recover::Fault,
    spec::{ComponentProfile, Execution, Value},
};

pub use line::{
    AGENT_LINE_BYTES_MAX, LINE_BYTES_MAX, LineBuffer, LineError, encode_agent_line, encode_line,
};

/// Version of this protocol, said in `hello` and `configure`.
pub const PROTOCOL_VERSION: u32 = 1;

/// Environment: path of the agent's socket for components.
pub const ENV_SOCKET: &str = "SDR_SOCKET";
/// Environment: the component's key as `system/name` or `system/name@robot`.
pub const ENV_COMPONENT: &str = "SDR_COMPONENT";
/// Environment: the instance's number.
pub const ENV_INSTANCE: &str = "SDR_INSTANCE";
/// Environment: how long to go on without an agent, milliseconds; `0` ends at once, absent
/// means for ever.
pub const ENV_ORPHAN_MS: &str = "SDR_ORPHAN_MS";
/// Environment: a secret word by which a later agent knows the process again.
pub const ENV_BADGE: &str = "SDR_BADGE";
/// Environment: how long to stay active without an agent, milliseconds; absent means for ever.
pub const ENV_LEASE_MS: &str = "SDR_LEASE_MS";
/// Environment: set when the process is to lock its memory.
pub const ENV_LOCK_MEMORY: &str = "SDR_LOCK_MEMORY";

/// The parameter that every component built with this crate has: bytes to hold and touch
/// from `on_initialize` to the end. A test aid: the paper's components "allocate a 500MB
/// memory region on startup and free it on termination".
pub const BALLAST_PARAMETER: &str = "ballast_bytes";
/// Most ballast that may be asked for, bytes.
pub const BALLAST_BYTES_MAX: i64 = 64 << 30;

/// Time between two `counters`.
pub const COUNTERS_PERIOD: Duration = Duration::from_millis(200);
/// Time between two `beat`s, unless the component ticks more slowly.
pub const BEAT_PERIOD: Duration = Duration::from_millis(100);
/// Time between two attempts to reach an agent that went away.
pub const RECONNECT_PERIOD: Duration = Duration::from_millis(200);

/// From a component to its agent.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(tag = "type", rename_all = "snake_case")]
pub enum FromComponent {
    /// First line of each connection.
    Hello(Box<Hello>),
    /// The state changed; also the answer to a command that changed nothing.
    State(StateReport),
    /// An input accepted a greater token than before; sent at once.
    Heard(Heard),
    /// Sign of life of the execution thread itself.
    Beat(Beat),
    /// Figures of all ports, each [`COUNTERS_PERIOD`].
    Counters(Counters),
    /// The agent's line could not be understood (the connection is closed then), or was
    /// refused and changed nothing.
    Error(ErrorReport),
}

/// From the agent to a component.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(tag = "type", rename_all = "snake_case")]
pub enum ToComponent {
    /// Answer to a `hello` whose state is `created`; once in a process's life.
    Configure(Box<Configure>),
    /// Change of state; idempotent.
    Command(Order),
    /// New values while it runs; `on_parameters_changed`, `on_rate_changed`.
    Reconfigure(Reconfigure),
    /// The component's line could not be understood; the agent closes the connection.
    Error(ErrorReport),
}

/// Who greets.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Hello {
    /// [`PROTOCOL_VERSION`] of the component.
    pub v: u32,
    /// Which component it is an instance of, from [`ENV_COMPONENT`].
    pub component: ComponentKey,
    /// Which instance, from [`ENV_INSTANCE`].
    pub instance: InstanceId,
    /// Its process.
    pub pid: u32,
    /// The word of [`ENV_BADGE`]; a component that does not know it may leave it out.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub badge: Option<String>,
    /// Ports and parameters.
    pub profile: ComponentProfile,
    /// Present state: `created` in a fresh process, otherwise what outlived the last agent.
    pub now: StateReport,
}

/// Where the component stands.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct StateReport {
    /// The state.
    pub state: LifecycleState,
    /// The token under which it is active; `null` when it is not.
    #[serde(default)]
    pub token: Option<Token>,
    /// Why it is in the error state.
    #[serde(default)]
    pub fault: Option<Fault>,
}

/// The first accepted sample of a greater token.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Heard {
    /// The connection's index in the system.
    pub connection: u16,
    /// The token accepted.
    pub token: Token,
    /// CLOCK_MONOTONIC when it was accepted.
    pub at_ns: u64,
}

/// How the execution thread does.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct Beat {
    /// Ticks so far.
    pub ticks: u64,
    /// Ticks that began late by more than half a period, or were skipped.
    pub late: u64,
    /// Longest time between two ticks since the last beat, nanoseconds.
    pub period_worst_ns: u64,
    /// Longest callback since the last beat, nanoseconds.
    pub execute_worst_ns: u64,
}

/// Figures of all ports.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct Counters {
    /// CLOCK_MONOTONIC when they were taken.
    pub at_ns: u64,
    /// Each output once.
    pub outputs: Vec<OutputCounters>,
    /// Each connection into the instance once.
    pub inputs: Vec<InputCounters>,
}

/// As [`sdr_core::recording::OutputSample`].
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct OutputCounters {
    /// The port.
    pub port: Name,
    /// Samples sent by this instance so far.
    pub sent: u64,
    /// Their bytes.
    pub sent_bytes: u64,
}

/// As [`sdr_core::recording::ConnectionSample`].
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct InputCounters {
    /// The connection's index in the system.
    pub connection: u16,
    /// Samples accepted by this instance so far.
    pub accepted: u64,
    /// Samples missing in the sequence so far.
    pub lost: u64,
    /// Samples refused because of an old token so far.
    pub fenced: u64,
    /// Deadlines that passed without a sample while it was active, so far.
    pub late: u64,
    /// Samples that were no message of the port's type so far.
    #[serde(default)]
    pub broken: u64,
    /// First sample accepted by this instance, CLOCK_MONOTONIC; 0 when none.
    pub first_ns: u64,
    /// Last sample accepted, CLOCK_MONOTONIC; 0 when none.
    pub last_ns: u64,
    /// Longest pause between two accepted samples that ended since the last counters.
    pub gap_max_ns: u64,
    /// Median period of the last up to 64 samples; 0 when unknown.
    pub period_median_ns: u64,
    /// Number of the epoch of the last accepted sample.
    pub epoch: u64,
}

/// Everything an instance needs to know.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Configure {
    /// [`PROTOCOL_VERSION`] of the agent.
    pub v: u32,
    /// Which component it is.
    pub component: ComponentKey,
    /// Values for its parameters; those not named keep their default.
    #[serde(default)]
    pub parameters: BTreeMap<String, Value>,
    /// Where its devices are, by name: a path or an address.
    #[serde(default)]
    pub devices: BTreeMap<String, String>,
    /// Its wired inputs; one port may have several connections.
    #[serde(default)]
    pub inputs: Vec<InputWiring>,
    /// How many samples a reader of its outputs may fall behind, 1..=64.
    pub output_depth: u8,
    /// Where the robot's shared memory is.
    pub memory: SharedMemory,
    /// When `on_execute` is called.
    pub execution: ExecutionSetup,
}

/// Where a robot's shared memory is.
#[derive(Clone, Debug, PartialEq, Eq, Hash, Serialize, Deserialize)]
pub struct SharedMemory {
    /// Beginning of the names in /dev/shm, at most 12 bytes.
    pub prefix: String,
    /// Folder of its services, at most 50 bytes, on a tmpfs; made when missing.
    pub root: PathBuf,
}

/// When `on_execute` is called: `{"periodic":{"period_us":20000}}` or `"on_data"`.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum ExecutionSetup {
    /// At a fixed period.
    Periodic {
        /// Microseconds, at least 100.
        period_us: u64,
    },
    /// When any input has a new sample.
    OnData,
}

impl From<Execution> for ExecutionSetup {
    fn from(execution: Execution) -> Self {
        match execution {
            Execution::Periodic { period } => {
                let period_us = u64::try_from(period.as_micros()).unwrap_or(u64::MAX);
                Self::Periodic { period_us }
            }
            Execution::OnData => Self::OnData,
        }
    }
}

/// A change of state.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(tag = "do", rename_all = "snake_case")]
pub enum Order {
    /// Execute under this token. While active: go on under it when it is greater.
    Activate {
        /// Stamped on every sample from now on.
        token: Token,
    },
    /// Stop executing, stay initialised.
    Deactivate,
    /// Deactivate if need be, finalise, end the process.
    Finish,
    /// Leave the error state.
    Reset,
}

/// New values while it runs.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Reconfigure {
    /// Only those that change.
    #[serde(default)]
    pub parameters: BTreeMap<String, Value>,
    /// The new rate, when it changes; only between periodic ones.
    #[serde(default)]
    pub execution: Option<ExecutionSetup>,
}

/// Why a line could not be used.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct ErrorReport {
    /// Where, what was found, what is allowed.
    pub message: String,
}

/// Reads a key as it stands in [`ENV_COMPONENT`]: `system/name` or `system/name@robot`.
pub fn parse_component_key(text: &str) -> Result<ComponentKey, String> {
    let (path, robot) = match text.split_once('@') {
        Some((path, robot)) => (path, Some(robot)),
        None => (text, None),
    };
    let (system, name) =
        path.split_once('/').ok_or("no component; allowed: system/name or system/name@robot")?;
    let scope = robot.map(RobotId::new).transpose().map_err(|error| error.to_string())?;
    let system = Name::new(system).map_err(|error| error.to_string())?;
    let name = Name::new(name).map_err(|error| error.to_string())?;
    Ok(ComponentKey { system, name, scope })
}

#[cfg(test)]
mod tests;
