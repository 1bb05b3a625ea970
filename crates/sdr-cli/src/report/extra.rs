//! What recordings cannot tell and a demo knows: the machine, the world's truth, the policies' bars.
//!
//! A demo keeps it as `demo.json` beside its recordings, so that `sdr report` makes the same report
//! from them again. Whatever is not there stays unknown.

use std::{fs, path::Path};

use serde::{Deserialize, Serialize};

use super::machine::Machine;
use crate::lab::{Told, Verdict};

/// Name of the file beside the recordings.
pub(crate) const FILE: &str = "demo.json";
/// Largest such file, bytes: half an hour of truth and commands.
const FILE_BYTES_MAX: u64 = 64 << 20;

/// See the module.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(default)]
pub(crate) struct Extra {
    /// Whether components touched 500 MB each.
    pub(crate) ballast: Option<bool>,
    /// Where it ran.
    pub(crate) machine: Option<Machine>,
    /// How the radio was played.
    pub(crate) radio: Option<Radio>,
    /// Levels that matter in the figures.
    pub(crate) bars: Option<Bars>,
    /// Holders of the role as the fleet's status said.
    pub(crate) coordinator: Coordinator,
    /// All components, in the system's order.
    pub(crate) components: Vec<String>,
    /// All connections as `fisheye.image -> anomaly.image`, in the system's order.
    pub(crate) connections: Vec<String>,
    /// Later moments are left out: clearing up is no part of the run.
    pub(crate) until_ns: Option<u64>,
    /// The topic of the estimate that the truth is compared with.
    pub(crate) position_topic: Option<String>,
    /// Where the driven body was.
    pub(crate) truth: Vec<TruthPoint>,
    /// When commands reached its wheels, CLOCK_MONOTONIC, oldest first.
    pub(crate) commands_ns: Vec<u64>,
    /// What became of the dangerous object.
    pub(crate) detector: Option<Detector>,
    /// What the cameras showed instead of the world.
    pub(crate) pictures: Option<String>,
    /// The topic of the detector's verdicts.
    pub(crate) danger_topic: Option<String>,
    /// What a scenario of the lab was, and what came of it.
    pub(crate) lab: Option<Lab>,
}

/// A scenario of the lab.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(default)]
pub(crate) struct Lab {
    /// Its name.
    pub(crate) scenario: String,
    /// What it says of itself.
    pub(crate) about: String,
    /// What drew its radio.
    pub(crate) seed: u64,
    /// What was done, and when.
    pub(crate) timeline: Vec<Told>,
    /// What was expected, and what was found.
    pub(crate) expectations: Vec<Verdict>,
}

/// How the radio was played.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub(crate) struct Radio {
    /// Whose level fades.
    pub(crate) robot: String,
    /// Before, dBm.
    pub(crate) from_dbm: f64,
    /// After, dBm.
    pub(crate) to_dbm: f64,
    /// Spread of the noise, dB.
    pub(crate) noise_db: f64,
    /// How long the fade takes, seconds.
    pub(crate) fade_s: f64,
    /// What carries the data meanwhile.
    pub(crate) carrier: String,
}

/// The bars of Tables V and VI, as the deployed policies have them; `None` where they have none.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(default)]
pub(crate) struct Bars {
    /// Table V: free memory that allocation wants to be left.
    pub(crate) allocation_memory_bytes: Option<u64>,
    /// The same in recovery, when the first has no answer.
    pub(crate) relaxed_memory_bytes: Option<u64>,
    /// Table VI: free memory at which recovery moves.
    pub(crate) recovery_memory_bytes: Option<u64>,
    /// Table VI: level at which recovery moves, dBm.
    pub(crate) recovery_rssi_dbm: Option<f64>,
    /// How long the level must hold, seconds.
    pub(crate) recovery_rssi_hold_s: Option<f64>,
}

/// Who held the coordinator role.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub(crate) struct Coordinator {
    /// When the system was deployed.
    pub(crate) at_start: Option<String>,
    /// At the end.
    pub(crate) at_end: Option<String>,
}

/// One moment of the truth.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub(crate) struct TruthPoint {
    /// CLOCK_MONOTONIC.
    pub(crate) monotonic_ns: u64,
    /// In the world's frame, metres.
    pub(crate) x_m: f64,
    /// In the world's frame, metres.
    pub(crate) y_m: f64,
}

/// What became of the dangerous object.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub(crate) struct Detector {
    /// How often the object was put before the robot.
    pub(crate) shown: u32,
    /// How often the robot came to a stand while it stood there.
    pub(crate) stops: u32,
    /// How often it came to a stand without it.
    pub(crate) stops_without_cause: u32,
    /// From the object's appearance to the stand, ms; `None` when it did not stop.
    pub(crate) stop_after_ms: Option<f64>,
    /// Distance to the object when it stood, metres.
    pub(crate) stop_distance_m: Option<f64>,
    /// From the object's disappearance to the next motion, ms.
    pub(crate) resumed_after_ms: Option<f64>,
    /// Way driven, metres.
    pub(crate) distance_m: f64,
}

impl Extra {
    /// The file in `folder`, when there is one that can be read; else the reason for a note.
    pub(crate) fn load(folder: &Path) -> Result<Option<Self>, String> {
        let path = folder.join(FILE);
        let size = match fs::metadata(&path) {
            Ok(metadata) => metadata.len(),
            Err(_) => return Ok(None),
        };
        if size > FILE_BYTES_MAX {
            return Err(format!("{FILE}: {size} bytes, at most {FILE_BYTES_MAX}; left out"));
        }
        let text = fs::read(&path).map_err(|error| format!("{FILE}: {error}; left out"))?;
        serde_json::from_slice(&text)
            .map(Some)
            .map_err(|error| format!("{FILE}: {error}; left out"))
    }
}
