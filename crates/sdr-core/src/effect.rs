//! Everything the brain can ask for. What came of it returns as the next input.

use alloc::{
    boxed::Box,
    collections::{BTreeMap, BTreeSet},
    string::String,
    sync::Arc,
    vec::Vec,
};
use core::net::SocketAddr;

use serde::{Deserialize, Serialize};

use crate::{
    allocate::Problem,
    api::Accepted,
    event::Event,
    id::{ComponentKey, Name, RobotId},
    input::{InstanceId, PlanId, RequestId, StoreTicket},
    mesh::{Fact, Facts},
    order::{Run, Token},
    record::FleetKey,
    spec::{ComponentSpec, Qos},
};

/// One order to the shell.
#[derive(Clone, Debug, PartialEq)]
pub enum Effect {
    /// Send a datagram, once, without waiting.
    Send {
        /// Whither.
        to: SocketAddr,
        /// At most 1200 bytes.
        bytes: Vec<u8>,
    },
    /// Put on disk what changed, together with all changes before that did not get there;
    /// answered by `Stored`.
    Store {
        /// Names the order.
        ticket: StoreTicket,
        /// What is new since the order before.
        change: StoredChange,
    },
    /// Start a process; answered by instance news.
    Launch(Box<LaunchOrder>),
    /// Tell an instance something.
    Command {
        /// Which one.
        instance: InstanceId,
        /// What.
        command: Command,
    },
    /// The data plane between robots should look like this from now on.
    Routes(Vec<Route>),
    /// Ask an allocator, off the loop; answered by `Planned`.
    Plan {
        /// Names the question.
        plan: PlanId,
        /// The question.
        problem: Box<Problem>,
    },
    /// Answer an API client.
    Answer {
        /// Whom.
        request: RequestId,
        /// What; the error is a sentence for the operator.
        result: Result<Accepted, String>,
    },
    /// Tell operators and the recording.
    Event(Event),
}

/// How to start an instance.
#[derive(Clone, Debug, PartialEq)]
pub struct LaunchOrder {
    /// Names the instance.
    pub instance: InstanceId,
    /// The component it is an instance of.
    pub component: ComponentKey,
    /// What to run and with which parameters.
    pub spec: ComponentSpec,
    /// Its wired inputs.
    pub inputs: Vec<InputWiring>,
    /// Paths of its outputs are `port_path(component, port)`; how deep their readers go.
    pub output_depth: u8,
}

/// One connection into an instance.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct InputWiring {
    /// Its port.
    pub port: Name,
    /// The connection's index in the system.
    pub connection: u16,
    /// The output's path in shared memory ([`crate::spec::port_path`]).
    pub path: String,
    /// The ROS 2 type.
    pub message_type: String,
    /// Depth and deadline.
    pub qos: Qos,
}

/// What an instance can be told. All are idempotent.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Command {
    /// Execute under this token.
    Activate(Token),
    /// Stop executing, stay initialised.
    Deactivate,
    /// Deactivate if need be, finalise, end the process; killed when it does not within its grace.
    Finish,
    /// End the process at once.
    Kill,
    /// Leave the error state.
    Reset,
}

/// A port that crosses robots, from this robot's side.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Route {
    /// The output's path in shared memory; its topic is this behind `rt/`.
    pub path: String,
    /// The ROS 2 type.
    pub message_type: String,
    /// Reliability and depth.
    pub qos: Qos,
    /// Which way.
    pub direction: Direction,
    /// Robots at the far end.
    pub peers: Vec<RobotId>,
}

/// Which way a route goes, seen from this robot.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Direction {
    /// Local producer, remote consumers: forward samples that carry this token; none while
    /// there is no active instance here or no consumer runs elsewhere (endpoints exist and are
    /// matched already).
    Out {
        /// The token of the local active instance, when somebody elsewhere wants its samples.
        active: Option<Token>,
    },
    /// Remote producer, local consumers.
    In,
}

/// What an agent must not forget: all changes together.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct StoredState {
    /// Incarnations so far.
    pub incarnation: u64,
    /// The fleet table.
    pub fleet: Facts,
    /// Runs reserved per component: activations below this number may have been sent.
    pub runs: BTreeMap<ComponentKey, Run>,
    /// Peers heard so far.
    pub peers: Vec<SocketAddr>,
    /// Epochs reserved per component: numbers up to this one may have been sent.
    #[serde(default)]
    pub epochs: BTreeMap<ComponentKey, u64>,
    /// Robots ever heard of.
    #[serde(default)]
    pub robots: BTreeSet<RobotId>,
}

impl StoredState {
    /// Takes a change in; it costs what changed, not what is there.
    pub fn take(&mut self, change: StoredChange) {
        if change.whole {
            *self = Self::default();
        }
        self.incarnation = change.incarnation;
        for key in &change.dropped {
            self.fleet.remove(key);
        }
        for fact in change.facts {
            self.fleet.put(fact);
        }
        self.runs.extend(change.runs);
        self.epochs.extend(change.epochs);
        self.robots.extend(change.robots);
        if let Some(peers) = change.peers {
            self.peers = peers;
        }
    }
}

/// What is new of a [`StoredState`]; facts are shared with the brain that ordered it.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct StoredChange {
    /// It is all there is: what was ordered before is void.
    pub whole: bool,
    /// Incarnations so far.
    pub incarnation: u64,
    /// Facts that are new, in place of those under their keys.
    pub facts: Vec<Arc<Fact>>,
    /// Facts that are gone.
    pub dropped: Vec<FleetKey>,
    /// Runs reserved since.
    pub runs: Vec<(ComponentKey, Run)>,
    /// Epochs reserved since.
    pub epochs: Vec<(ComponentKey, u64)>,
    /// All peers, when there are others than before.
    pub peers: Option<Vec<SocketAddr>>,
    /// Robots heard of for the first time.
    pub robots: Vec<RobotId>,
}
