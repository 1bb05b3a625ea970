//! What the agent's API answers and `sdr -o json` prints. Field names are contracts.

use alloc::{collections::BTreeMap, string::String, vec::Vec};

use serde::{Deserialize, Serialize};

use crate::{
    allocate::{Homeless, Placement},
    event::Event,
    fitness::RolePolicy,
    id::{Name, RobotId},
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
    /// The role in full.
    #[serde(default)]
    pub role: RoleView,
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

/// `POST /v1/role/move`.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct RoleMoveRequest {
    /// Who should hold the coordinator role.
    pub to: RobotId,
}

/// `POST /v1/role/policy`.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct RolePolicyRequest {
    /// The checked policy.
    pub policy: RolePolicy,
}

/// Answer to a change of the role or its policy that was accepted and stored.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct RoleAnswer {
    /// The holder from now on; null before the first.
    pub holder: Option<String>,
    /// Its term.
    pub term: u64,
    /// False when it was so already.
    pub changed: bool,
}

/// `POST /v1/reset`.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct ResetRequest {
    /// Of which system.
    pub system: Name,
    /// Which component.
    pub component: Name,
}

/// Answer to a reset that was accepted and stored.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct ResetAnswer {
    /// The component, with its system.
    pub component: String,
    /// What latched it; null when nothing did.
    pub was: Option<String>,
}

/// What came of a request that was accepted.
#[derive(Clone, Debug, PartialEq)]
pub enum Accepted {
    /// A system was deployed or undeployed.
    System(DeployAnswer),
    /// A component was reset.
    Reset(ResetAnswer),
    /// The role or its policy was changed.
    Role(RoleAnswer),
}

/// The coordinator role as one robot sees it.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct RoleView {
    /// Who holds it.
    pub holder: Option<String>,
    /// Which holder that is, counted.
    pub term: u64,
    /// An operator named the holder.
    pub by_operator: bool,
    /// This robot holds it, and decides nothing because it hears nobody.
    pub suspended: bool,
    /// Who follows when the holder is silent, the first first; empty when it did not say.
    pub successors: Vec<String>,
    /// Who is being offered the role.
    pub offered_to: Option<String>,
    /// Why it is offered.
    pub reason: String,
    /// Name of the policy in force.
    pub policy: String,
    /// The policy in force, as [`RolePolicyRequest`] takes it.
    #[serde(default)]
    pub rules: RolePolicy,
    /// Living robots that may hold it, the best first.
    pub candidates: Vec<CandidateView>,
}

/// One robot that may hold the role.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct CandidateView {
    /// Its name.
    pub robot: String,
    /// 0 to 1000.
    pub points: u32,
    /// Why it should not hold it.
    pub unfit: Option<String>,
    /// robot.toml or the policy puts it before the others.
    pub preferred: bool,
    /// What the points are made of.
    pub parts: Vec<FitnessPartView>,
}

/// One aspect of a robot's fitness.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct FitnessPartView {
    /// `battery`, `cpu`, `memory`, `links` or `centrality`.
    pub aspect: String,
    /// 0 to 1000.
    pub score: u32,
    /// How much it counts.
    pub weight: u16,
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

/// Answer of `POST /v1/stop`: components end, then the agent.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct StopAnswer {
    /// Whose.
    pub robot: String,
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
