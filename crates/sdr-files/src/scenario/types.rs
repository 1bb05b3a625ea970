//! A scenario that was checked.

use std::{path::PathBuf, time::Duration};

use sdr_core::{
    id::{Name, RobotId},
    lifecycle::LifecycleState,
    units::{Bytes, Dbm, Permille},
};

/// What is played, and what must come of it.
#[derive(Clone, Debug)]
pub struct Scenario {
    /// Its name.
    pub name: String,
    /// One sentence.
    pub about: String,
    /// Who takes part, in the order of the file.
    pub robots: Vec<RobotSetup>,
    /// Who should hold the coordinator role at the start.
    pub coordinator: Option<RobotId>,
    /// The robot whose wheels are used in the world of rovers; `None`: no world.
    pub driven: Option<RobotId>,
    /// Systems that run before time 0, as paths that can be opened.
    pub systems: Vec<PathBuf>,
    /// Times of the mesh; `None` is the agent's default.
    pub gone_after: Option<Duration>,
    /// As above.
    pub gossip_period: Option<Duration>,
    /// Whether components outlive their agent.
    pub components_stay: bool,
    /// The radio of all robots at the start.
    pub radio: LinkSettings,
    /// What happens and what is expected, by time.
    pub steps: Vec<Step>,
    /// When it ends, after time 0.
    pub ends: Duration,
}

/// One robot at the start.
#[derive(Clone, Debug)]
pub struct RobotSetup {
    /// Its name.
    pub name: RobotId,
    /// What components may use of its memory.
    pub memory: Bytes,
    /// What components may use of its CPU; `None`: the machine's cores, less what is played.
    pub cpu: Option<Permille>,
    /// Charge.
    pub battery: Permille,
    /// Free words.
    pub labels: Vec<String>,
    /// Parts of the body without a file.
    pub devices: Vec<Name>,
    /// Where it stands, from the access point; `None`: its level is stated.
    pub place: Option<Place>,
    /// A disk of its own for the agent's state.
    pub disk: Option<Bytes>,
    /// Whether its disk can be slowed: some step does it.
    pub slows: bool,
}

/// x and y, millimetres.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Place {
    /// To the east, say.
    pub x_mm: i32,
    /// To the north.
    pub y_mm: i32,
}

/// What is stated of a link; `None` leaves it as it is.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct LinkSettings {
    /// Mean level.
    pub level: Option<Dbm>,
    /// How long the level takes to get there.
    pub over: Duration,
    /// Packets lost, retries or not.
    pub loss: Option<Permille>,
    /// Single tries that fail.
    pub try_loss: Option<Permille>,
    /// Bursts of loss.
    pub bursts: Option<BurstSettings>,
    /// Added to each packet, each way.
    pub delay: Option<Duration>,
    /// Mean of what is added to that.
    pub jitter: Option<Duration>,
    /// Bits a second.
    pub rate: Option<u64>,
    /// What may wait.
    pub queue: Option<Bytes>,
    /// Corners round which it goes.
    pub corners: Option<u8>,
}

/// Bursts of loss, both times exponential.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct BurstSettings {
    /// Lost within one.
    pub loss: Permille,
    /// Mean time between two.
    pub every: Duration,
    /// Mean time one lasts.
    pub lasting: Duration,
}

/// One line of the timeline.
#[derive(Clone, Debug)]
pub struct Step {
    /// When, after time 0.
    pub at: Duration,
    /// The line of the file.
    pub line: u32,
    /// What.
    pub what: Action,
}

/// Which way a robot is cut off.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Cut {
    /// It hears nothing and is not heard.
    Both,
    /// It is not heard.
    Out,
    /// It hears nothing.
    In,
}

/// What is sent to a process.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Blow {
    /// SIGKILL.
    Kill,
    /// SIGTERM.
    Term,
    /// SIGSTOP.
    Stop,
    /// SIGCONT.
    Continue,
}

/// Which processes are meant.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Target {
    /// The agent of a robot.
    Agent(RobotId),
    /// A component, on one robot or wherever it runs.
    Component(String, Option<RobotId>),
}

/// What happens.
#[derive(Clone, Debug)]
pub enum Action {
    /// Links of robots change.
    Link(Vec<RobotId>, Box<LinkSettings>),
    /// A robot goes somewhere.
    Move(RobotId, Place, Duration),
    /// Robots are cut off for a while.
    Outage(Vec<RobotId>, Cut, Option<Duration>),
    /// Those inside and those outside do not hear each other.
    Split(String, Vec<RobotId>, Option<Duration>),
    /// A split is over, or the outage of a robot of that name.
    Heal(String),
    /// A battery's charge changes.
    Battery(RobotId, Permille, Duration),
    /// Other programs leave so much memory.
    Memory(RobotId, Bytes),
    /// Other programs use so much CPU.
    Cpu(RobotId, Permille),
    /// A signal.
    Signal(Target, Blow),
    /// An agent is started again.
    Start(RobotId),
    /// Robots lose their power, and get it back after a while.
    Power(Vec<RobotId>, Option<Duration>),
    /// Power comes back.
    PowerOn(Vec<RobotId>),
    /// A disk is full, or has room again.
    DiskFull(RobotId, bool),
    /// Writes to a disk take so long.
    DiskSlow(RobotId, Duration),
    /// A component `faulty` is told to misbehave: the component, its robot, the order.
    Faulty(String, Option<RobotId>, String),
    /// An operator's command, sent to a robot's agent.
    Sdr {
        /// Which agent.
        robot: RobotId,
        /// Words after `sdr`.
        words: Vec<String>,
        /// Whether it should fail.
        fails: bool,
    },
    /// Something must come true.
    Expect(Box<Expectation>),
}

/// Something that must come true.
#[derive(Clone, Debug)]
pub struct Expectation {
    /// What.
    pub what: Wanted,
    /// When.
    pub when: When,
    /// Whose view counts; `None`: the one concerned, else all who answer.
    pub seen_from: Option<RobotId>,
}

/// When something must be true.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum When {
    /// At some moment before this time is over.
    Within(Duration),
    /// At every moment until this time is over.
    Lasting(Duration),
}

/// A robot, or any but one.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Choice {
    /// This one.
    Is(RobotId),
    /// Any other.
    IsNot(RobotId),
}

/// What must be true.
#[derive(Clone, Debug)]
pub enum Wanted {
    /// A component is active at its home.
    Home(Name, Choice),
    /// A component's state; `None`: it has none.
    State(Name, Option<LifecycleState>),
    /// All answering agents name the same holder.
    Coordinator(Choice),
    /// So many agents hold the role.
    Coordinators(u8),
    /// A robot is taken for alive, or for gone.
    Seen(RobotId, bool),
    /// All components are active and all connections heard.
    Running,
    /// No process of a component starts or ends, no component gets another home.
    Unchanged,
    /// Events since the step.
    Event(Box<EventWanted>),
    /// Samples of a connection missing in the sequence, over the whole run.
    Lost(String, u64),
    /// Longest pause of a connection around the recovery.
    Pause(String, Duration),
}

/// Events that must be said, or must not.
#[derive(Clone, Debug)]
pub struct EventWanted {
    /// The kind.
    pub kind: String,
    /// Who says it.
    pub robot: Option<RobotId>,
    /// What it is about.
    pub component: Option<Name>,
    /// Part of its reason.
    pub reason: Option<String>,
    /// So often at least.
    pub at_least: u32,
    /// So often at most.
    pub at_most: Option<u32>,
}
