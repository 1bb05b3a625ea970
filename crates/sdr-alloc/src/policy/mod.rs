//! What a policy may say about placing: bars, order, weights, and what to do with unknown facts.

use alloc::{string::String, vec::Vec};
use core::{fmt, time::Duration};

use sdr_core::{
    id::RobotId,
    spec::{Needs, PolicyBytes},
    units::{Bytes, Dbm, Permille},
};
use serde::{Deserialize, Serialize};

mod check;

pub use check::PolicyError;

/// First byte of an encoded policy; raised when fields change.
pub const POLICY_VERSION: u8 = 1;

/// How to place the components of one system.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Policy {
    /// Its name, for reasons and reports.
    pub name: String,
    /// Which way to choose among robots that fit.
    pub strategy: Strategy,
    /// In which order first-fit asks robots.
    pub start_with: StartWith,
    /// Bars of the first tier.
    pub strict: Bars,
    /// Bars of the second tier, tried only in recovery and only when the first has no answer;
    /// `None` leaves only the first.
    pub relaxed: Option<Bars>,
    /// What counts for a fact that nobody can tell.
    pub unknown: Unknown,
    /// What counts for a need of zero, which nobody declared or measured.
    pub default_needs: Needs,
    /// A robot where an instance runs already is taken before anything is started elsewhere.
    pub reuse_standbys: bool,
    /// What best-score weighs.
    pub weights: Weights,
}

/// Which way to choose among robots that fit.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
#[non_exhaustive]
pub enum Strategy {
    /// The first robot of the list that fits.
    FirstFit,
    /// The robot with the greatest weighted score.
    BestScore,
}

impl Strategy {
    /// The word that stands in policies.
    pub fn word(self) -> &'static str {
        match self {
            Self::FirstFit => "first-fit",
            Self::BestScore => "best-score",
        }
    }
}

/// In which order first-fit asks robots.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum StartWith {
    /// The robot that received the file, then by name.
    Receiver,
    /// These in this order, then the others by name.
    List(Vec<RobotId>),
    /// By distance from the receiver; where that is unknown, behind the others, by name.
    Nearest,
}

/// Bars that a robot or a link must meet *after* placing. `None` sets no bar.
///
/// Memory is judged even without a bar: what is left is never below zero.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct Bars {
    /// CPU in use, as a share of the robot's capacity.
    pub cpu_used_at_most: Option<Permille>,
    /// Memory left.
    pub memory_free_at_least: Option<Bytes>,
    /// Charge.
    pub battery_at_least: Option<BatteryBar>,
    /// Radio level of a pair: the worse of its two ends.
    pub rssi_at_least: Option<Dbm>,
    /// Jitter of a pair.
    pub jitter_at_most: Option<Duration>,
    /// Distance of a pair.
    pub distance_at_most: Option<Millimetres>,
    /// Half a round trip of a pair.
    pub delay_at_most: Option<Duration>,
    /// Lost datagrams of a pair.
    pub loss_at_most: Option<Permille>,
}

impl Bars {
    /// No bar at all.
    pub const fn none() -> Self {
        Self {
            cpu_used_at_most: None,
            memory_free_at_least: None,
            battery_at_least: None,
            rssi_at_least: None,
            jitter_at_most: None,
            distance_at_most: None,
            delay_at_most: None,
            loss_at_most: None,
        }
    }

    /// Whether any bar of Table II is set.
    pub fn judge_links(&self) -> bool {
        self.rssi_at_least.is_some()
            || self.jitter_at_most.is_some()
            || self.distance_at_most.is_some()
            || self.delay_at_most.is_some()
            || self.loss_at_most.is_some()
    }
}

/// A bar on the charge of a robot.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct BatteryBar {
    /// The charge.
    pub at_least: Permille,
    /// Counts only for components that need at least this much CPU, thousandths of one core.
    pub if_needs_cpu: Option<Permille>,
}

impl BatteryBar {
    /// A bar for every component.
    pub const fn new(at_least: Permille) -> Self {
        Self { at_least, if_needs_cpu: None }
    }
}

/// A distance in millimetres.
#[derive(
    Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, Deserialize,
)]
#[serde(transparent)]
pub struct Millimetres(pub u64);

impl fmt::Display for Millimetres {
    /// Metres with one decimal.
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}.{} m", self.0 / 1000, self.0 / 100 % 10)
    }
}

/// What counts for a fact that nobody can tell. Never zero by itself.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct Unknown {
    /// Charge of a robot.
    pub battery: IfUnknown<Permille>,
    /// Radio level of a robot.
    pub rssi: IfUnknown<Dbm>,
    /// Jitter of a pair.
    pub jitter: IfUnknown<Duration>,
    /// Distance of a pair.
    pub distance: IfUnknown<Millimetres>,
    /// Half a round trip of a pair.
    pub delay: IfUnknown<Duration>,
    /// Loss of a pair.
    pub loss: IfUnknown<Permille>,
}

/// What counts for one fact when it is unknown.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum IfUnknown<T> {
    /// A bar on it is not met.
    #[default]
    Refuse,
    /// The worst value that is known of any robot or pair of the problem; refused when
    /// none is known.
    Worst,
    /// This value.
    Assume(T),
}

/// What best-score weighs; greater is better. Each term lies in 0..=1.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Weights {
    /// Memory left after placing, against the robot with the most memory free.
    pub memory_left: Weight,
    /// CPU left after placing, against the robot's capacity.
    pub cpu_left: Weight,
    /// Charge.
    pub battery: Weight,
    /// Radio level of the pairs it would talk over: -90 dBm is 0, -40 dBm is 1.
    pub link_quality: Weight,
    /// Distance of the pairs it would talk over: 0 m is 1, 50 m is one half.
    pub nearness: Weight,
    /// An instance runs there already.
    pub stay: Weight,
}

/// A weight in thousandths: 1000 is 1.0. At most [`Weight::MAX`].
#[derive(
    Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, Deserialize,
)]
#[serde(transparent)]
pub struct Weight(pub u32);

impl Weight {
    /// 1000.0, so that a sum of weighted terms stays far inside 64 bits.
    pub const MAX: Self = Self(1_000_000);
}

impl Default for Policy {
    /// Tables I and II with bars that suit ordinary Wi-Fi; `policies/allocation/default.yaml`
    /// says the same.
    fn default() -> Self {
        Self {
            name: String::from("default"),
            strategy: Strategy::BestScore,
            start_with: StartWith::Receiver,
            strict: Bars {
                cpu_used_at_most: Some(Permille(800)),
                memory_free_at_least: Some(Bytes::mega(200)),
                battery_at_least: Some(BatteryBar::new(Permille(300))),
                rssi_at_least: Some(Dbm::from_tenths(-750)),
                jitter_at_most: Some(Duration::from_millis(50)),
                distance_at_most: Some(Millimetres(30_000)),
                ..Bars::none()
            },
            relaxed: Some(Bars {
                cpu_used_at_most: Some(Permille(900)),
                memory_free_at_least: Some(Bytes::mega(150)),
                battery_at_least: Some(BatteryBar::new(Permille(200))),
                ..Bars::none()
            }),
            unknown: Unknown {
                battery: IfUnknown::Assume(Permille(1000)),
                rssi: IfUnknown::Assume(Dbm::from_tenths(-600)),
                distance: IfUnknown::Assume(Millimetres(0)),
                ..Unknown::default()
            },
            default_needs: Needs { memory: Bytes::mega(100), cpu: Permille(250) },
            reuse_standbys: true,
            weights: Weights::default(),
        }
    }
}

impl Default for Weights {
    fn default() -> Self {
        Self {
            memory_left: Weight(1000),
            cpu_left: Weight(1000),
            battery: Weight(1000),
            link_quality: Weight(2000),
            nearness: Weight(1000),
            stay: Weight(3000),
        }
    }
}

impl Policy {
    /// The policy in `policy`; empty bytes mean [`Policy::default`].
    pub fn decode(policy: &PolicyBytes) -> Result<Self, PolicyError> {
        let Some((version, rest)) = policy.bytes.split_first() else {
            return Ok(Self::default());
        };
        if *version != POLICY_VERSION {
            return Err(PolicyError::Version { found: *version });
        }
        let read: Self = postcard::from_bytes(rest).map_err(|_| PolicyError::Unreadable)?;
        read.check()?;
        Ok(read)
    }

    /// The policy as systems carry it: a version byte, then postcard.
    pub fn encode(&self) -> PolicyBytes {
        let mut bytes = alloc::vec![POLICY_VERSION];
        bytes
            .extend(postcard::to_allocvec(self).expect("writing plain data to memory cannot fail"));
        PolicyBytes { name: self.name.clone(), bytes }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_policy_survives_the_wire_and_empty_bytes_mean_the_default() {
        let policy = Policy { strategy: Strategy::FirstFit, ..Policy::default() };

        assert_eq!(Policy::decode(&policy.encode()), Ok(policy));
        assert_eq!(Policy::decode(&PolicyBytes::default()), Ok(Policy::default()));
        assert!(Policy::default().encode().bytes.len() < 200);
    }

    #[test]
    fn broken_and_later_bytes_are_refused() {
        let mut bytes = Policy::default().encode();
        bytes.bytes[0] = 9;
        assert_eq!(Policy::decode(&bytes), Err(PolicyError::Version { found: 9 }));

        bytes.bytes[0] = POLICY_VERSION;
        bytes.bytes.truncate(20);
        assert_eq!(Policy::decode(&bytes), Err(PolicyError::Unreadable));
    }
}
