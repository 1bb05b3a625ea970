//! Everything the brain can be told.

use alloc::{boxed::Box, string::String, vec::Vec};
use core::{net::SocketAddr, time::Duration};

use crate::{
    allocate::{AllocError, Plan},
    blob::BlobRef,
    effect::InputWiring,
    fitness::RolePolicy,
    id::{ComponentKey, Name, RobotId},
    lifecycle::LifecycleState,
    order::Token,
    recover::Cause,
    report::{HostReport, RobotFacts, Usage},
    spec::{ComponentSpec, SystemSpec},
};

/// Names one started process of a component on this robot; grows, also past those adopted.
pub type InstanceId = u64;
/// Names one request of an API client.
pub type RequestId = u64;
/// Names one [`crate::effect::Effect::Store`]; grows.
pub type StoreTicket = u64;
/// Names one [`crate::effect::Effect::Plan`]; grows.
pub type PlanId = u64;
/// Names one [`crate::effect::Effect::Ask`]; grows.
pub type QuestionId = u64;

/// One cause that a program of the operator's found.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Finding {
    /// The component, by its name in the system.
    pub component: Name,
    /// What is wrong with it; `None`: the only cause that the program may find.
    pub cause: Option<Cause>,
    /// Why, for people.
    pub reason: String,
}

/// One thing that happened outside.
#[derive(Clone, Debug, PartialEq)]
pub enum Input {
    /// Time passed; nothing else.
    Tick,
    /// A datagram arrived; any bytes at all.
    Datagram {
        /// Whence.
        from: SocketAddr,
        /// What, at most 65,535 bytes.
        bytes: Vec<u8>,
    },
    /// A fresh sample of the host's figures, 5 to 10 times a second.
    Host(HostReport),
    /// The body or its limits changed, such as the executables that can be launched.
    Facts(Box<RobotFacts>),
    /// Fresh figures of instances.
    Usage(Vec<(InstanceId, Usage)>),
    /// News of an instance.
    Instance {
        /// Which one; news of an unknown one is dropped.
        instance: InstanceId,
        /// What happened.
        news: InstanceNews,
    },
    /// The DDS endpoints of a route have this many peers now.
    Route {
        /// The output's path, as in [`crate::effect::Route`].
        path: String,
        /// Matched remote endpoints.
        matched: u16,
    },
    /// An operator wants a system.
    Deploy {
        /// To be answered.
        request: RequestId,
        /// Checked by the shell, checked again by the brain.
        system: SystemSpec,
    },
    /// An operator wants a system gone.
    Undeploy {
        /// To be answered.
        request: RequestId,
        /// Which one.
        system: Name,
    },
    /// An operator wants a component to be tried anew, whatever held it.
    Reset {
        /// To be answered.
        request: RequestId,
        /// Which one.
        component: ComponentKey,
    },
    /// An operator wants a robot to hold the coordinator role.
    MoveRole {
        /// To be answered.
        request: RequestId,
        /// Which robot.
        to: RobotId,
    },
    /// An operator wants the holder chosen otherwise.
    RolePolicy {
        /// To be answered.
        request: RequestId,
        /// How; checked by the shell.
        policy: Box<RolePolicy>,
    },
    /// A program of the operator's answered, or did not.
    Told {
        /// Of which question.
        question: QuestionId,
        /// What it found; the error is for people.
        result: Result<Vec<Finding>, String>,
    },
    /// The agent is about to be away for a planned moment: others are to know.
    Hold {
        /// How long at most.
        time: Duration,
    },
    /// A plan is ready.
    Planned {
        /// Of which question.
        plan: PlanId,
        /// The answer.
        result: Result<Plan, AllocError>,
    },
    /// What came of [`crate::effect::Effect::Fetch`].
    Fetched {
        /// Which blob.
        blob: BlobRef,
        /// Its bytes, or why nobody gave them, for people.
        result: Result<Vec<u8>, String>,
    },
    /// A store order reached the disk.
    Stored {
        /// This one, and all before it.
        ticket: StoreTicket,
    },
    /// A store order failed; the disk holds what it held before.
    StoreFailed {
        /// Which one.
        ticket: StoreTicket,
        /// Why, for people.
        reason: String,
    },
}

/// A process that outlived the agent which started it.
#[derive(Clone, Debug, PartialEq)]
pub struct Adoption {
    /// Process id; the shell made sure that it is the same process.
    pub pid: u32,
    /// The component it is an instance of.
    pub component: ComponentKey,
    /// What it was started with.
    pub spec: ComponentSpec,
    /// How it was wired.
    pub inputs: Vec<InputWiring>,
}

/// What happened to an instance.
#[derive(Clone, Debug, PartialEq)]
pub enum InstanceNews {
    /// It outlived the agent before this one and goes on; told before anything else. Its
    /// state follows when it greets.
    Adopted(Box<Adoption>),
    /// Its process runs.
    Started {
        /// Process id.
        pid: u32,
    },
    /// It could not be started.
    LaunchFailed {
        /// Why.
        reason: String,
    },
    /// It said which state it is in.
    State {
        /// The state.
        state: LifecycleState,
        /// The token it works under, when active.
        token: Option<Token>,
        /// Why it is in error, when it is.
        fault: Option<(Cause, String)>,
    },
    /// One of its inputs accepted a greater token.
    Heard {
        /// The connection's index in its system.
        connection: u16,
        /// The token accepted.
        token: Token,
    },
    /// One of its inputs counted samples that came later than its deadline.
    Late {
        /// The connection's index in its system.
        connection: u16,
        /// How many, since the instance began.
        count: u64,
    },
    /// Its process ended.
    Exited {
        /// Status and last lines of output.
        reason: String,
    },
    /// Its process ended because memory was short: its limit's, or the robot's.
    OutOfMemory {
        /// Status and last lines of output.
        reason: String,
    },
    /// No heartbeat came from its execution thread, or it never connected.
    Hung {
        /// What was waited for and how long.
        reason: String,
    },
}
