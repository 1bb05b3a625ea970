//! Samples of runs, and the figures made of them.

use std::collections::BTreeMap;

use serde::Serialize;

use super::Violation;

/// Everything measured in one run or several.
#[derive(Debug, Clone, Default)]
pub struct Record {
    /// Virtual seconds.
    pub virtual_s: f64,
    /// Real seconds.
    pub real_s: f64,
    /// Robots times virtual hours while they were on.
    pub robot_hours: f64,
    /// Judgements "gone" about a robot that was up and had been reachable.
    pub false_deaths: u64,
    /// Takings of the coordinator role from a holder that was up and had been reachable.
    pub false_takeovers: u64,
    /// From a kill to each observer's judgement "gone", ms.
    pub detection_ms: Vec<f64>,
    /// From a kill to each observer's judgement "quiet", ms.
    pub quiet_ms: Vec<f64>,
    /// From a deployment to 99 % of the robots holding it, ms; one for each marker.
    pub known99_ms: Vec<f64>,
    /// From the kill of a coordinator to the next one, ms.
    pub coordinator_gap_ms: Vec<f64>,
    /// From the moment a silent coordinator is suspect until the next one acts, ms.
    pub takeover_ms: Vec<f64>,
    /// In each planned hand-over of the role, time in which neither end acted, ms.
    pub handover_gap_ms: Vec<f64>,
    /// In each planned hand-over of the role, time in which both ends acted, ms.
    pub handover_overlap_ms: Vec<f64>,
    /// Bytes a second of each robot, converged and idle.
    pub bytes_per_robot_s: Vec<f64>,
    /// The same of guard beats.
    pub guard_bytes_per_robot_s: Vec<f64>,
    /// The fleet's mean of each section of the datagrams, by run.
    pub section_bytes_per_robot_s: BTreeMap<&'static str, Vec<f64>>,
    /// Bytes to and from a robot with an empty disk until it knew everything.
    pub join_bytes: Vec<f64>,
    /// From the first start to everything running, ms.
    pub converged_ms: Vec<f64>,
    /// Questions to the allocator.
    pub replans: u64,
    /// Changes of a home.
    pub moves: u64,
    /// Of these, away from a home that was up and well.
    pub needless_moves: u64,
    /// Calls of `handle`.
    pub handled: u64,
    /// Rules broken.
    pub violations: Vec<Violation>,
    /// Hash of everything that happened.
    pub trace_hash: u64,
}

/// Three points of a distribution; null when there are no samples.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Spread {
    /// Half of the samples are at or below.
    pub p50: Option<f64>,
    /// 99 % of the samples are at or below.
    pub p99: Option<f64>,
    /// The greatest.
    pub max: Option<f64>,
}

/// Two points of a distribution; null when there are no samples.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Rate {
    /// Half of the robots are at or below.
    pub p50: Option<f64>,
    /// The greatest.
    pub max: Option<f64>,
}

/// What `sdr sim run -o json` prints. Field names are a contract.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Figures {
    /// Virtual time simulated.
    pub virtual_s: f64,
    /// Real time it took.
    pub real_s: f64,
    /// Judgements "gone" about a robot that was up and reachable.
    pub false_deaths: u64,
    /// The role taken from a holder that was up and reachable.
    pub false_takeovers: u64,
    /// Robots times hours on.
    pub robot_hours: f64,
    /// Kill to "gone", each observer.
    pub detection_ms: Spread,
    /// Kill to "quiet", each observer.
    pub quiet_ms: Spread,
    /// The slowest marker: 99 % hold it.
    pub known99_ms: Option<f64>,
    /// Kill of a coordinator to the next.
    pub coordinator_gap_ms: Spread,
    /// A silent coordinator suspect until the next one acts.
    pub takeover_ms: Spread,
    /// Planned hand-overs: neither end acts.
    pub handover_gap_ms: Spread,
    /// Planned hand-overs: both ends act.
    pub handover_overlap_ms: Spread,
    /// Converged and idle, headers and seal included, guard beats not.
    pub bytes_per_robot_s: Rate,
    /// Guard beats alone.
    pub guard_bytes_per_robot_s: Rate,
    /// The mean robot's by section of the datagrams, guard beats too, UDP, IP and seal not.
    pub section_bytes_per_robot_s: BTreeMap<&'static str, f64>,
    /// The largest join with an empty disk.
    pub join_bytes: Option<f64>,
    /// Start to everything running, the slowest.
    pub converged_ms: Option<f64>,
    /// Questions to the allocator.
    pub replans: u64,
    /// Changes of a home.
    pub moves: u64,
    /// Away from a home that was well.
    pub needless_moves: u64,
    /// Calls of `handle`.
    pub handled: u64,
    /// Rules broken.
    pub violations: Vec<Violation>,
    /// Sixteen hexadecimal digits.
    pub trace_hash: String,
}

impl Record {
    /// Adds the samples of another run.
    pub fn add(&mut self, other: Self) {
        self.virtual_s += other.virtual_s;
        self.real_s += other.real_s;
        self.robot_hours += other.robot_hours;
        self.false_deaths += other.false_deaths;
        self.false_takeovers += other.false_takeovers;
        self.detection_ms.extend(other.detection_ms);
        self.quiet_ms.extend(other.quiet_ms);
        self.known99_ms.extend(other.known99_ms);
        self.coordinator_gap_ms.extend(other.coordinator_gap_ms);
        self.takeover_ms.extend(other.takeover_ms);
        self.handover_gap_ms.extend(other.handover_gap_ms);
        self.handover_overlap_ms.extend(other.handover_overlap_ms);
        self.bytes_per_robot_s.extend(other.bytes_per_robot_s);
        self.guard_bytes_per_robot_s.extend(other.guard_bytes_per_robot_s);
        for (name, rates) in other.section_bytes_per_robot_s {
            self.section_bytes_per_robot_s.entry(name).or_default().extend(rates);
        }
        self.join_bytes.extend(other.join_bytes);
        self.converged_ms.extend(other.converged_ms);
        self.replans += other.replans;
        self.moves += other.moves;
        self.needless_moves += other.needless_moves;
        self.handled += other.handled;
        self.violations.extend(other.violations);
        self.trace_hash = self.trace_hash.rotate_left(1) ^ other.trace_hash;
    }

    /// The figures.
    pub fn figures(&self) -> Figures {
        Figures {
            virtual_s: tenths(self.virtual_s, 1000.0),
            real_s: tenths(self.real_s, 1000.0),
            false_deaths: self.false_deaths,
            false_takeovers: self.false_takeovers,
            robot_hours: tenths(self.robot_hours, 10_000.0),
            detection_ms: spread(&self.detection_ms),
            quiet_ms: spread(&self.quiet_ms),
            known99_ms: greatest(&self.known99_ms),
            coordinator_gap_ms: spread(&self.coordinator_gap_ms),
            takeover_ms: spread(&self.takeover_ms),
            handover_gap_ms: spread(&self.handover_gap_ms),
            handover_overlap_ms: spread(&self.handover_overlap_ms),
            bytes_per_robot_s: rate(&self.bytes_per_robot_s),
            guard_bytes_per_robot_s: rate(&self.guard_bytes_per_robot_s),
            section_bytes_per_robot_s: self.section_means(),
            join_bytes: greatest(&self.join_bytes),
            converged_ms: greatest(&self.converged_ms),
            replans: self.replans,
            moves: self.moves,
            needless_moves: self.needless_moves,
            handled: self.handled,
            violations: self.violations.clone(),
            trace_hash: format!("{:016x}", self.trace_hash),
        }
    }

    fn section_means(&self) -> BTreeMap<&'static str, f64> {
        let mean = |rates: &[f64]| rates.iter().sum::<f64>() / rates.len().max(1) as f64;
        let means = self.section_bytes_per_robot_s.iter();
        let means = means.map(|(name, rates)| (*name, tenths(mean(rates), 10.0)));
        means.filter(|(_, mean)| *mean > 0.0).collect()
    }
}

fn spread(samples: &[f64]) -> Spread {
    Spread { p50: at(samples, 0.5), p99: at(samples, 0.99), max: at(samples, 1.0) }
}

fn rate(samples: &[f64]) -> Rate {
    Rate { p50: at(samples, 0.5), max: at(samples, 1.0) }
}

fn greatest(samples: &[f64]) -> Option<f64> {
    at(samples, 1.0)
}

/// The smallest sample with this share of all at or below it.
fn at(samples: &[f64], share: f64) -> Option<f64> {
    let mut sorted = samples.to_vec();
    sorted.sort_by(f64::total_cmp);
    let rank = crate::cast::rounded((share * sorted.len() as f64).ceil());
    let index = usize::try_from(rank.max(1) - 1).unwrap_or(0);
    sorted.get(index).map(|sample| tenths(*sample, 10.0))
}

fn tenths(value: f64, times: f64) -> f64 {
    (value * times).round() / times
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn points_of_a_distribution_are_samples_of_it() {
        let samples: Vec<f64> = (1..=100).rev().map(f64::from).collect();
        let expected = Spread { p50: Some(50.0), p99: Some(99.0), max: Some(100.0) };
        assert_eq!(spread(&samples), expected);
        assert_eq!(spread(&[]), Spread { p50: None, p99: None, max: None });
        assert_eq!(spread(&[7.0]).p50, Some(7.0));
    }
}
