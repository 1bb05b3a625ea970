//! The messages of an agent's recording (MCAP, ROS 2 schemas, CDR): one struct and one
//! `.msg` text each. Topics are `/sdr/<robot>/metrics`, `.../components`, `.../connections`,
//! `.../outputs`, `.../events`, with `-` in a robot's name written `_`.
//!
//! Field order is the wire order; fields are only ever appended.

use alloc::{string::String, vec::Vec};

use serde::{Deserialize, Serialize};

/// `builtin_interfaces/msg/Time`: wall time of the robot, for people only.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct Stamp {
    /// Seconds since 1970.
    pub sec: i32,
    /// Nanoseconds within the second.
    pub nanosec: u32,
}

/// A message of the recording.
pub trait Recorded {
    /// ROS 2 type name.
    const TYPE: &'static str;
    /// Last word of its topic.
    const TOPIC: &'static str;
    /// The `.msg` text with the texts of the types it uses, as `ros2msg` schemas hold it.
    const DEFINITION: &'static str;
}

macro_rules! definition {
    ($text:literal) => {
        concat!(
            $text,
            "================================================================================\n",
            "MSG: builtin_interfaces/Time\nint32 sec\nuint32 nanosec\n"
        )
    };
}

/// A robot's figures, once a sample (5 to 10 Hz). Unknown floats are NaN.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct RobotMetrics {
    /// Wall time.
    pub stamp: Stamp,
    /// CLOCK_MONOTONIC of the machine.
    pub monotonic_ns: u64,
    /// The robot.
    pub robot: String,
    /// What components may use in all.
    pub memory_capacity_bytes: u64,
    /// Capacity less use.
    pub memory_free_bytes: u64,
    /// PSS of the agent and all below it.
    pub memory_used_bytes: u64,
    /// Thousandths of one core.
    pub cpu_permille: u32,
    /// 0..=100.
    pub battery_percent: f32,
    /// One raw sample.
    pub rssi_dbm: f32,
    /// In the fleet's frame.
    pub x_m: f32,
    /// In the fleet's frame.
    pub y_m: f32,
    /// The agent alone: resident memory.
    pub agent_rss_bytes: u64,
    /// The agent alone: proportional share.
    pub agent_pss_bytes: u64,
    /// The agent alone: thousandths of one core.
    pub agent_cpu_permille: u32,
}

impl Recorded for RobotMetrics {
    const TYPE: &'static str = "sdr_msgs/msg/RobotMetrics";
    const TOPIC: &'static str = "metrics";
    const DEFINITION: &'static str = definition!(
        "builtin_interfaces/Time stamp\nuint64 monotonic_ns\nstring robot\nuint64 memory_capacity_bytes\nuint64 memory_free_bytes\nuint64 memory_used_bytes\nuint32 cpu_permille\nfloat32 battery_percent\nfloat32 rssi_dbm\nfloat32 x_m\nfloat32 y_m\nuint64 agent_rss_bytes\nuint64 agent_pss_bytes\nuint32 agent_cpu_permille\n"
    );
}

/// An instance on this robot, on each change of state and once a second.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct ComponentSample {
    /// Wall time.
    pub stamp: Stamp,
    /// CLOCK_MONOTONIC of the machine.
    pub monotonic_ns: u64,
    /// The robot.
    pub robot: String,
    /// The system.
    pub system: String,
    /// The component.
    pub component: String,
    /// `created`, `inactive`, `active`, `error`, `finalized`; `ended` when the process is gone.
    pub state: String,
    /// Number of the epoch; 0 while only prepared.
    pub epoch: u64,
    /// Activation within the epoch.
    pub run: u32,
    /// PSS of its process.
    pub memory_bytes: u64,
    /// Thousandths of one core.
    pub cpu_permille: u32,
}

impl Recorded for ComponentSample {
    const TYPE: &'static str = "sdr_msgs/msg/ComponentSample";
    const TOPIC: &'static str = "components";
    const DEFINITION: &'static str = definition!(
        "builtin_interfaces/Time stamp\nuint64 monotonic_ns\nstring robot\nstring system\nstring component\nstring state\nuint64 epoch\nuint32 run\nuint64 memory_bytes\nuint32 cpu_permille\n"
    );
}

/// One connection as its consumer saw it in the last window (about 200 ms).
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct ConnectionSample {
    /// Wall time.
    pub stamp: Stamp,
    /// CLOCK_MONOTONIC of the machine.
    pub monotonic_ns: u64,
    /// The consumer's robot.
    pub robot: String,
    /// The system.
    pub system: String,
    /// `fisheye.image -> anomaly.image`.
    pub connection: String,
    /// Samples accepted by this instance so far.
    pub accepted: u64,
    /// Samples missing in the sequence so far.
    pub lost: u64,
    /// Samples refused because of an old token so far.
    pub fenced: u64,
    /// Samples later than the deadline so far.
    pub late: u64,
    /// First sample accepted by this instance, CLOCK_MONOTONIC; 0 when none.
    pub first_ns: u64,
    /// Last sample accepted, CLOCK_MONOTONIC; 0 when none.
    pub last_ns: u64,
    /// Longest pause between two accepted samples that ended in this window; 0 when none ended.
    pub gap_max_ns: u64,
    /// Median period of the last up to 64 samples; 0 when unknown.
    pub period_median_ns: u64,
    /// Number of the epoch of the last accepted sample.
    pub epoch: u64,
}

impl Recorded for ConnectionSample {
    const TYPE: &'static str = "sdr_msgs/msg/ConnectionSample";
    const TOPIC: &'static str = "connections";
    const DEFINITION: &'static str = definition!(
        "builtin_interfaces/Time stamp\nuint64 monotonic_ns\nstring robot\nstring system\nstring connection\nuint64 accepted\nuint64 lost\nuint64 fenced\nuint64 late\nuint64 first_ns\nuint64 last_ns\nuint64 gap_max_ns\nuint64 period_median_ns\nuint64 epoch\n"
    );
}

/// One output as its producer sent it so far.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct OutputSample {
    /// Wall time.
    pub stamp: Stamp,
    /// CLOCK_MONOTONIC of the machine.
    pub monotonic_ns: u64,
    /// The producer's robot.
    pub robot: String,
    /// The system.
    pub system: String,
    /// `fisheye.image`.
    pub output: String,
    /// Samples sent by this instance so far.
    pub sent: u64,
    /// Their bytes.
    pub sent_bytes: u64,
}

impl Recorded for OutputSample {
    const TYPE: &'static str = "sdr_msgs/msg/OutputSample";
    const TOPIC: &'static str = "outputs";
    const DEFINITION: &'static str = definition!(
        "builtin_interfaces/Time stamp\nuint64 monotonic_ns\nstring robot\nstring system\nstring output\nuint64 sent\nuint64 sent_bytes\n"
    );
}

/// An event: what happened or was decided, see `docs/events.md`.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct EventSample {
    /// Wall time.
    pub stamp: Stamp,
    /// CLOCK_MONOTONIC of the machine.
    pub monotonic_ns: u64,
    /// Counts the events of the agent process.
    pub sequence: u64,
    /// The kind.
    pub kind: String,
    /// The robot that says it.
    pub robot: String,
    /// The system, or empty.
    pub system: String,
    /// The component, or empty.
    pub component: String,
    /// Number of the epoch, or 0.
    pub epoch: u64,
    /// Activation within the epoch, or 0.
    pub run: u32,
    /// Why.
    pub reason: String,
    /// Names of the figures.
    pub number_names: Vec<String>,
    /// The figures.
    pub number_values: Vec<f64>,
}

impl Recorded for EventSample {
    const TYPE: &'static str = "sdr_msgs/msg/EventSample";
    const TOPIC: &'static str = "events";
    const DEFINITION: &'static str = definition!(
        "builtin_interfaces/Time stamp\nuint64 monotonic_ns\nuint64 sequence\nstring kind\nstring robot\nstring system\nstring component\nuint64 epoch\nuint32 run\nstring reason\nstring[] number_names\nfloat64[] number_values\n"
    );
}
