//! Who should hold the coordinator role: a policy, and what it makes of a robot's figures.
//!
//! Points run from 0 to 1000: the weighted mean of what each aspect scores. A robot below a
//! bar is unfit whatever its points. All robots judge all others by the same policy.

use alloc::{
    format,
    string::{String, ToString},
    vec::Vec,
};
use core::{fmt, time::Duration};

use serde::{Deserialize, Serialize};

use crate::{
    id::RobotId,
    units::{Dbm, Permille},
};

/// Score of the weakest radio level that still counts, and of the strongest that matters.
const RSSI_RANGE_TENTHS: (i32, i32) = (-900, -500);
/// Points are compared in steps of this size, so that noise and views of different age
/// decide nothing.
const POINTS_STEP: u32 = 50;
/// Longest time that a fitter robot is made to wait for the role.
const MARGIN_FOR_MAX: Duration = Duration::from_secs(3600);
/// Longest wait of one successor for the other.
const STAGGER_MAX: Duration = Duration::from_secs(10);

/// How the holder of the role is chosen; one for the whole fleet.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct RolePolicy {
    /// Its name, for people.
    pub name: String,
    /// How much each aspect counts.
    pub weights: RoleWeights,
    /// What a holder must have.
    pub bars: RoleBars,
    /// Robots that hold it before all others while they are fit, the first first.
    pub pinned: Vec<RobotId>,
    /// Robots that never hold it.
    pub forbidden: Vec<RobotId>,
    /// A fitter robot gets the role when it is ahead by so many points ...
    pub margin: u32,
    /// ... for so long.
    pub margin_for: Duration,
    /// The holder tells its successors that it lives at this period.
    pub beat: Duration,
    /// So many periods without a beat make the holder suspect, 2 to 50; on a link that is
    /// measured to lose much it takes more.
    pub misses: u32,
    /// Each further successor waits so much longer.
    pub stagger: Duration,
    /// What the other of two robots does when one is gone.
    pub alone: Alone,
}

/// How much each aspect counts; all zero: all robots are alike.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct RoleWeights {
    /// Charge.
    pub battery: u16,
    /// CPU that is free.
    pub cpu: u16,
    /// Memory that is free.
    pub memory: u16,
    /// Quality of the links: level and loss.
    pub links: u16,
    /// Share of the living robots that it reaches directly.
    pub centrality: u16,
}

/// Bars; `None` asks for nothing. What is unknown is below no bar.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct RoleBars {
    /// Least charge.
    pub battery_min: Option<Permille>,
    /// Most CPU used, of its capacity.
    pub cpu_max: Option<Permille>,
    /// Least share of its memory that is free.
    pub memory_min: Option<Permille>,
    /// Least radio level.
    pub rssi_min: Option<Dbm>,
    /// Most loss over its links.
    pub loss_max: Option<Permille>,
}

/// What a robot does when the only other one is gone: nobody can be asked.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Alone {
    /// It takes the role.
    #[default]
    Promote,
    /// It waits.
    Wait,
}

impl Default for RolePolicy {
    fn default() -> Self {
        Self {
            name: String::from("default"),
            weights: RoleWeights { battery: 2, cpu: 1, memory: 1, links: 4, centrality: 2 },
            bars: RoleBars {
                battery_min: Some(Permille(200)),
                cpu_max: Some(Permille(950)),
                memory_min: None,
                rssi_min: Some(Dbm::from_tenths(-800)),
                loss_max: Some(Permille(400)),
            },
            pinned: Vec::new(),
            forbidden: Vec::new(),
            margin: 150,
            margin_for: Duration::from_secs(10),
            beat: Duration::from_millis(300),
            misses: 4,
            stagger: Duration::from_millis(250),
            alone: Alone::Promote,
        }
    }
}

/// One thing that speaks against a policy. Whoever wrote the policy can mend it.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct RolePolicyProblem {
    /// The key as a policy file has it, such as `bars.battery`.
    pub key: &'static str,
    /// What was found.
    pub found: String,
    /// What is allowed.
    pub allowed: &'static str,
}

impl fmt::Display for RolePolicyProblem {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}: {}; allowed: {}", self.key, self.found, self.allowed)
    }
}

/// Figures of one robot, as far as they are known.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Figures {
    /// Charge.
    pub battery: Option<Permille>,
    /// CPU used, of its capacity.
    pub cpu: Option<Permille>,
    /// Share of its memory that is free.
    pub memory: Option<Permille>,
    /// Radio level.
    pub rssi: Option<Dbm>,
    /// Mean loss over its links.
    pub loss: Option<Permille>,
    /// Share of the living robots that it reaches directly.
    pub centrality: Option<Permille>,
}

/// What a policy makes of a robot.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Fitness {
    /// 0 to 1000.
    pub points: u32,
    /// Score of each aspect, 0 to 1000, with its weight.
    pub parts: Vec<(&'static str, u32, u16)>,
    /// Why it must not hold the role.
    pub unfit: Option<String>,
}

impl Fitness {
    /// Points for comparing, in steps.
    pub fn coarse(&self) -> u32 {
        self.points / POINTS_STEP
    }
}

impl RolePolicy {
    /// What speaks against a policy, the first thing as a sentence; [`Self::problems`] has all.
    pub fn check(&self) -> Result<(), String> {
        self.problems().first().map_or(Ok(()), |problem| Err(problem.to_string()))
    }

    /// Everything that speaks against a policy.
    pub fn problems(&self) -> Vec<RolePolicyProblem> {
        let mut problems = Vec::new();
        let mut tell = |fine: bool, key, found: String, allowed| {
            if !fine {
                problems.push(RolePolicyProblem { key, found, allowed });
            }
        };
        let span = |time: Duration| format!("{} ms", time.as_millis());
        let beats = Duration::from_millis(50)..=Duration::from_secs(5);
        tell(beats.contains(&self.beat), "beat", span(self.beat), "50 ms to 5 s");
        tell((2..=50).contains(&self.misses), "misses", format!("{}", self.misses), "2 to 50");
        tell(self.margin <= 1000, "margin", format!("{}", self.margin), "0 to 1000 points");
        tell(self.margin_for <= MARGIN_FOR_MAX, "margin_for", span(self.margin_for), "0 s to 1 h");
        tell(self.stagger <= STAGGER_MAX, "stagger", span(self.stagger), "0 s to 10 s");
        let shares = [
            ("bars.battery", self.bars.battery_min),
            ("bars.cpu_used", self.bars.cpu_max),
            ("bars.memory_free", self.bars.memory_min),
            ("bars.loss", self.bars.loss_max),
        ];
        for (key, bar) in shares {
            let bar = bar.unwrap_or(Permille(0));
            tell(bar.0 <= 1000, key, share(bar), "0 % to 100 %");
        }
        for robot in self.pinned.iter().filter(|robot| self.forbidden.contains(robot)) {
            let found = format!("{robot} is both pinned and forbidden");
            tell(false, "forbidden", found, "one of the two");
        }
        problems
    }

    /// Judges one robot. What is unknown scores like the best: a robot on mains power has no
    /// battery to tell of.
    pub fn judge(&self, figures: &Figures) -> Fitness {
        let whole = |share: Option<Permille>| share.map_or(1000, |share| share.0.min(1000));
        let free = |share: Option<Permille>| share.map_or(1000, |used| 1000 - used.0.min(1000));
        let parts: Vec<(&'static str, u32, u16)> = [
            ("battery", whole(figures.battery), self.weights.battery),
            ("cpu", free(figures.cpu), self.weights.cpu),
            ("memory", whole(figures.memory), self.weights.memory),
            ("links", links_score(figures), self.weights.links),
            ("centrality", whole(figures.centrality), self.weights.centrality),
        ]
        .into();
        let weight: u32 = parts.iter().map(|(_, _, weight)| u32::from(*weight)).sum();
        let sum: u32 = parts.iter().map(|(_, score, weight)| score * u32::from(*weight)).sum();
        let points = sum.checked_div(weight).unwrap_or(1000);
        Fitness { points, parts, unfit: self.missed_bar(figures) }
    }

    /// The first bar that a robot misses, with numbers.
    fn missed_bar(&self, figures: &Figures) -> Option<String> {
        let below = |what: &str, found: Option<Permille>, bar: Option<Permille>| {
            let (found, bar) = (found?, bar?);
            (found < bar).then(|| format!("{what} {}, bar {}", share(found), share(bar)))
        };
        let above = |what: &str, found: Option<Permille>, bar: Option<Permille>| {
            let (found, bar) = (found?, bar?);
            (found > bar).then(|| format!("{what} {}, bar {}", share(found), share(bar)))
        };
        let level = || {
            let (found, bar) = (figures.rssi?, self.bars.rssi_min?);
            (found < bar).then(|| format!("rssi {found}, bar {bar}"))
        };
        below("battery", figures.battery, self.bars.battery_min)
            .or_else(|| above("cpu", figures.cpu, self.bars.cpu_max))
            .or_else(|| below("memory free", figures.memory, self.bars.memory_min))
            .or_else(level)
            .or_else(|| above("loss", figures.loss, self.bars.loss_max))
    }

    /// Place of `robot` among the pinned ones; those that are not stand behind all.
    pub fn pin(&self, robot: &RobotId) -> usize {
        self.pinned.iter().position(|pinned| pinned == robot).unwrap_or(self.pinned.len())
    }

    /// Beats that may be missed on a way that loses `loss`: a false suspicion costs a few
    /// questions, so five of ten thousand are rare enough.
    pub fn misses_at(&self, loss: Permille) -> u32 {
        misses_at(self.misses, loss)
    }
}

/// How many beats may be missed at this loss when `misses` may on a good link: where half of
/// all are lost and less, so many in a row are at most five of ten thousand.
pub(crate) fn misses_at(misses: u32, loss: Permille) -> u32 {
    let needed = match loss.0 {
        0..150 => 4,
        150..200 => 5,
        200..250 => 6,
        250..300 => 7,
        300..500 => 12,
        _ => 18,
    };
    misses.max(needed.min(misses.saturating_mul(4)))
}

/// The worse of level and loss.
fn links_score(figures: &Figures) -> u32 {
    let (low, high) = RSSI_RANGE_TENTHS;
    let level = figures.rssi.map_or(1000, |rssi| {
        let tenths = i32::from(rssi.tenths()).clamp(low, high);
        u32::try_from((tenths - low) * 1000 / (high - low)).unwrap_or(0)
    });
    // half of all lost is as good as no link
    let loss = figures.loss.map_or(1000, |loss| 1000 - (loss.0 * 2).min(1000));
    level.min(loss)
}

fn share(permille: Permille) -> String {
    format!("{}.{} %", permille.0 / 10, permille.0 % 10)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn points_are_the_weighted_mean_and_unknown_is_not_zero() {
        let policy = RolePolicy {
            weights: RoleWeights { battery: 1, cpu: 0, memory: 0, links: 3, centrality: 0 },
            ..RolePolicy::default()
        };
        assert_eq!(policy.judge(&Figures::default()).points, 1000);
        let half = Figures {
            battery: Some(Permille(400)),
            rssi: Some(Dbm::from_tenths(-700)),
            ..Figures::default()
        };
        assert_eq!(policy.judge(&half).points, (400 + 3 * 500) / 4);
    }

    #[test]
    fn a_missed_bar_is_named_with_its_numbers() {
        let weak = Figures { battery: Some(Permille(123)), ..Figures::default() };
        let fitness = RolePolicy::default().judge(&weak);
        assert_eq!(fitness.unfit.as_deref(), Some("battery 12.3 %, bar 20.0 %"));
    }

    #[test]
    fn all_that_speaks_against_a_policy_is_told() {
        let default = RolePolicy::default();
        assert_eq!(default.check(), Ok(()));
        let robot = RobotId::new("robot-1").unwrap();
        let bad = RolePolicy {
            bars: RoleBars { cpu_max: Some(Permille(1001)), ..RoleBars::default() },
            pinned: [robot.clone()].into(),
            forbidden: [robot].into(),
            margin: 1001,
            beat: Duration::from_millis(49),
            ..default
        };
        let keys: Vec<&str> = bad.problems().iter().map(|problem| problem.key).collect();
        assert_eq!(keys, ["beat", "margin", "bars.cpu_used", "forbidden"]);
        let told = bad.check().unwrap_err();
        assert_eq!(told, "beat: 49 ms; allowed: 50 ms to 5 s");
    }

    #[test]
    fn a_link_that_loses_more_is_given_more_time() {
        let policy = RolePolicy::default();
        let misses: Vec<u32> =
            [0, 100, 150, 200, 250, 400, 900].map(|loss| policy.misses_at(Permille(loss))).into();
        assert_eq!(misses, [4, 4, 5, 6, 7, 12, 16]);
    }

    #[test]
    fn so_many_beats_are_missed_in_a_row_five_times_of_ten_thousand() {
        for loss in 1..500 {
            let misses = misses_at(2, Permille(loss)).max(misses_at(4, Permille(loss)));
            let rows = (0..misses).fold(1.0, |rows, _| rows * f64::from(loss) / 1000.0);
            assert!(rows <= 5.1e-4, "{rows} at {loss}");
        }
    }
}
