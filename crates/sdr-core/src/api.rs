//! What the agent's API answers and `sdr -o json` prints. Field names are contracts.

use alloc::{collections::BTreeMap, string::String, vec::Vec};

use serde::{Deserialize, Serialize};

use crate::{
    allocate::{Homeless, Placement},
    event::Event,
    lifecycle::LifecycleState,
    spec::SystemSpec,
};

/// `GET /v1/status`.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct StatusView {
    /// The robot that answers.
    pub seen_from: String,
    /// The holder of the coordinator role, when known.
    pub coordinator: Option<String>,
    /// Its term.
    pub term: u64,
    /// All robots ever heard of, by name.
    pub robots: Vec<RobotView>,
    /// All systems, by name.
    pub systems: Vec<SystemView>,
    /// Causes that hold on the answering robot.
    pub conditions: Vec<ConditionView>,
}

/// One robot as another sees it.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct RobotView {
    /// Its name.
    pub name: String,
    /// Whether fresh news of it arrives.
    pub alive: bool,
    /// Age of the last fresh news, ms; 0 for the answering robot.
    pub seen_ms: u64,
    /// Whether it holds the coordinator role.
    pub coordinator: bool,
    /// CPU used by the agent and its components, thousandths of one core.
    pub cpu_permille: u32,
    /// Capacity less what the agent and its components use.
    pub memory_free_bytes: u64,
    /// What components may use in all.
    pub memory_capacity_bytes: u64,
    /// Charge; null when unknown.
    pub battery_permille: Option<u32>,
    /// Radio level; null when unknown.
    pub rssi_dbm: Option<f64>,
    /// Round trip to it, ms; null for the answering robot or when unknown.
    pub rtt_ms: Option<f64>,
    /// Where its API listens.
    pub api: String,
    /// What is wrong there.
    pub conditions: Vec<String>,
}

/// One system.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct SystemView {
    /// Its name.
    pub name: String,
    /// Grows with each deployment.
    pub revision: u64,
    /// In the order of the file.
    pub components: Vec<ComponentView>,
    /// In the order of the file.
    pub connections: Vec<ConnectionView>,
}

/// One component.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct ComponentView {
    /// Its name.
    pub name: String,
    /// Its home; null while homeless.
    pub home: Option<String>,
    /// The state of the instance at home; null when nothing is known of one.
    pub state: Option<LifecycleState>,
    /// The number of its epoch; 0 while homeless.
    pub epoch: u64,
    /// The robot that minted the epoch.
    pub epoch_minted_by: Option<String>,
    /// Activations within the epoch.
    pub run: u32,
    /// Restarts within the epoch.
    pub restarts: u32,
    /// What it takes.
    pub memory_bytes: u64,
    /// What it takes, thousandths of one core.
    pub cpu_permille: u32,
    /// Robots that hold another instance (standby, or target of a move).
    pub standbys: Vec<String>,
    /// Why it is where it is, or why it has no home.
    pub reason: String,
    /// Per robot and constraint, while homeless.
    #[serde(default)]
    pub refusals: Vec<crate::allocate::Refusal>,
}

/// One connection as the consumer sees it.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct ConnectionView {
    /// `fisheye.image -> anomaly.image`.
    pub name: String,
    /// Whether a sample of the producer's present token was accepted.
    pub heard: bool,
    /// Whether it crosses robots.
    pub remote: bool,
}

/// A cause that holds.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct ConditionView {
    /// The system.
    pub system: String,
    /// The component.
    pub component: String,
    /// The word of the cause.
    pub cause: String,
    /// For how long, ms.
    pub held_ms: u64,
    /// How long it must hold, ms.
    pub hold_ms: u64,
    /// Whether it is raised.
    pub raised: bool,
    /// With numbers.
    pub reason: String,
}

/// `POST /v1/deploy`.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct DeployRequest {
    /// The checked system.
    pub system: SystemSpec,
}

/// Answer to a deployment that was accepted and stored.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct DeployAnswer {
    /// The system.
    pub system: String,
    /// Its revision.
    pub revision: u64,
    /// False when the same system was deployed already and nothing changed.
    pub changed: bool,
}

/// An event as the API and recordings give it.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct EventView {
    /// Counts the events of this agent process, from 1.
    pub sequence: u64,
    /// Wall time of the robot, ms since 1970; for people only.
    pub wall_ms: u64,
    /// Monotonic time of the machine (CLOCK_MONOTONIC), ns: comparable between agents of one machine.
    pub monotonic_ns: u64,
    /// The event.
    #[serde(flatten)]
    pub event: Event,
}

/// The latest plan, `GET /v1/plan`.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct PlanView {
    /// The system.
    pub system: String,
    /// Which allocator.
    pub allocator: String,
    /// Who goes where and why not elsewhere.
    pub placements: Vec<Placement>,
    /// Who has no home.
    pub homeless: Vec<Homeless>,
}

/// Any refusal of the API: HTTP status 4xx or 5xx.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct ErrorAnswer {
    /// What was wrong: where, what was found, what is allowed.
    pub error: String,
    /// Counters or places, when there are any.
    #[serde(default, skip_serializing_if = "BTreeMap::is_empty")]
    pub details: BTreeMap<String, String>,
}
