//! What is printed with `-o json` and kept as `lab.json`. Field names are contracts (`docs/lab.md`).

use std::collections::BTreeMap;

use sdr_lab::bed::Traffic;
use serde::{Deserialize, Serialize};

use super::judged::Verdict;
use crate::report::summary::Summary;

/// Name of the file in the folder of the report.
pub(super) const FILE: &str = "lab.json";
/// Version of the format.
pub(super) const FORMAT: u32 = 1;

/// The whole answer.
#[derive(Debug, Serialize)]
pub(super) struct LabAnswer<'a> {
    pub(super) format: u32,
    pub(super) scenario: &'a str,
    pub(super) about: &'a str,
    pub(super) seed: u64,
    /// Whether every expectation was met.
    pub(super) met: bool,
    /// From time 0 to the end.
    pub(super) duration_s: f64,
    pub(super) expectations: &'a [Verdict],
    pub(super) timeline: &'a [Told],
    /// By robot.
    pub(super) radio: BTreeMap<&'a str, Traffic>,
    /// `report.json`.
    pub(super) report: &'a Summary,
    pub(super) out: String,
}

/// One thing that was done, or turned out.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub(crate) struct Told {
    /// After time 0.
    pub(crate) at_s: f64,
    /// CLOCK_MONOTONIC.
    pub(crate) monotonic_ns: u64,
    /// What.
    pub(crate) text: String,
}
