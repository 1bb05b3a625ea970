//! The motion controller: goes on, unless there is a reason to stop.

use std::time::Duration;

use sdr_lab::tunnel::Pose;
use serde::{Deserialize, Serialize};

use super::area::Area;
use super::path::{Guide, GuideSettings, Path};

/// Period assumed for the first order and the longest believed, seconds.
const PERIOD_S: (f64, f64) = (0.02, 0.1);

/// How to drive and when not to.
#[derive(Debug, Clone, PartialEq)]
pub struct Settings {
    /// How to follow the path.
    pub guide: GuideSettings,
    /// Where the rover may be.
    pub area: Area,
    /// How fast the speed may grow, metres a second squared.
    pub accelerate_max: f64,
    /// How fast the speed may fall, metres a second squared.
    pub brake_max: f64,
    /// How fast the rate of turn may change, radians a second squared.
    pub turn_change_max: f64,
    /// Danger lasts so much longer than it was last seen.
    pub danger_hold: Duration,
    /// A pose older than this is no pose.
    pub stale_after: Duration,
    /// A detector that was heard and then says nothing for so long is blind.
    pub danger_stale_after: Duration,
}

impl Settings {
    /// The usual limits in an area.
    pub fn in_area(area: Area) -> Self {
        Self {
            guide: GuideSettings::default(),
            area,
            accelerate_max: 0.5,
            brake_max: 1.5,
            turn_change_max: 4.0,
            danger_hold: Duration::from_secs(1),
            stale_after: Duration::from_millis(500),
            danger_stale_after: Duration::from_secs(1),
        }
    }

    fn check(&self) -> Result<(), SettingsError> {
        let rules = [
            ("speed_max", self.guide.speed_max, 0.01, 2.0),
            ("turn_max", self.guide.turn_max, 0.05, 10.0),
            ("lookahead_m", self.guide.lookahead_m, 0.1, 5.0),
            ("accelerate_max", self.accelerate_max, 0.01, 20.0),
            ("brake_max", self.brake_max, 0.1, 20.0),
            ("turn_change_max", self.turn_change_max, 0.1, 100.0),
            ("danger_hold", self.danger_hold.as_secs_f64(), 0.0, 60.0),
            ("stale_after", self.stale_after.as_secs_f64(), 0.05, 10.0),
            ("danger_stale_after", self.danger_stale_after.as_secs_f64(), 0.05, 10.0),
        ];
        for (name, value, low, high) in rules {
            if !(low..=high).contains(&value) {
                return Err(SettingsError { name, value, low, high });
            }
        }
        Ok(())
    }
}

/// A setting outside its range.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[error("{name} is {value}, allowed are {low} to {high} (SI units)")]
pub struct SettingsError {
    /// Which.
    pub name: &'static str,
    /// As found.
    pub value: f64,
    /// Least allowed.
    pub low: f64,
    /// Most allowed.
    pub high: f64,
}

/// Why the rover drives or not.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Verdict {
    /// Nothing against it.
    Drive,
    /// The dangerous object is seen, or was a moment ago.
    Danger,
    /// The detector was heard before and says nothing now: what is ahead is not known.
    Blind,
    /// There is no fresh pose.
    NoPose,
    /// The pose is outside the area.
    Outside,
    /// The path is at its end.
    Arrived,
}

/// What the wheels shall do now.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Order {
    /// Speed ahead, metres a second.
    pub linear: f64,
    /// Rate of turn to the left, radians a second.
    pub angular: f64,
    /// Why.
    pub verdict: Verdict,
}

/// What a successor needs to go on: no jump in speed, the same lane, the same danger.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize, Deserialize)]
pub struct Progress {
    /// Metres along the path.
    pub along_m: Option<f64>,
    /// Last speed ordered, metres a second.
    pub linear: f64,
    /// Last rate of turn ordered, radians a second.
    pub angular: f64,
    /// How much longer danger lasts.
    pub danger_left: Duration,
}

/// Turns danger and poses into orders. All times are of one monotonic clock.
#[derive(Debug, Clone)]
pub struct Controller {
    settings: Settings,
    guide: Guide,
    danger_until: Option<Duration>,
    /// When the detector was last heard, whatever it said.
    detector_at: Option<Duration>,
    pose: Option<(Duration, Pose)>,
    ordered: Option<Duration>,
    linear: f64,
    angular: f64,
}

impl Controller {
    /// A controller at rest that has seen nothing yet.
    pub fn new(settings: Settings, path: Path) -> Result<Self, SettingsError> {
        settings.check()?;
        let guide = Guide::new(path, settings.guide);
        Ok(Self {
            settings,
            guide,
            danger_until: None,
            detector_at: None,
            pose: None,
            ordered: None,
            linear: 0.0,
            angular: 0.0,
        })
    }

    /// Takes what the detector says; danger outlasts it by the hold.
    pub fn handle_danger(&mut self, now: Duration, danger: bool) {
        self.detector_at = Some(now);
        if danger {
            self.danger_until = Some(now + self.settings.danger_hold);
        }
    }

    /// Takes a pose; one that is not finite is no pose.
    pub fn handle_pose(&mut self, now: Duration, pose: Pose) {
        if pose.x.is_finite() && pose.y.is_finite() && pose.yaw.is_finite() {
            self.pose = Some((now, pose));
        }
    }

    /// Goes on where another controller was.
    pub fn resume(&mut self, now: Duration, progress: &Progress) {
        let limits = self.settings.guide;
        self.guide.resume(progress.along_m);
        if progress.linear.is_finite() && progress.angular.is_finite() {
            self.linear = progress.linear.clamp(-limits.speed_max, limits.speed_max);
            self.angular = progress.angular.clamp(-limits.turn_max, limits.turn_max);
        }
        if !progress.danger_left.is_zero() {
            self.danger_until = Some(now + progress.danger_left.min(self.settings.danger_hold));
        }
    }

    /// What to do now; call it at the rate of the loop.
    pub fn order(&mut self, now: Duration) -> Order {
        let verdict = self.verdict(now);
        let (linear, angular, verdict) = match (verdict, self.pose) {
            (Verdict::Drive, Some((_, pose))) => match self.guide.steer(&pose) {
                (0.0, 0.0) => (0.0, 0.0, Verdict::Arrived),
                (linear, angular) => (linear, angular, Verdict::Drive),
            },
            (stop, _) => (0.0, 0.0, stop),
        };
        let elapsed =
            self.ordered.map_or(PERIOD_S.0, |last| now.saturating_sub(last).as_secs_f64());
        let seconds = elapsed.min(PERIOD_S.1);
        self.ordered = Some(now);
        let Settings { accelerate_max, brake_max, turn_change_max, .. } = self.settings;
        let slower = linear.abs() < self.linear.abs() || linear * self.linear < 0.0;
        let rate = if slower { brake_max } else { accelerate_max };
        self.linear = towards(self.linear, linear, rate * seconds);
        self.angular = towards(self.angular, angular, turn_change_max * seconds);
        Order { linear: self.linear, angular: self.angular, verdict }
    }

    /// What a successor needs.
    pub fn progress(&self, now: Duration) -> Progress {
        let until = self.danger_until.unwrap_or_default();
        Progress {
            along_m: self.guide.along_m(),
            linear: self.linear,
            angular: self.angular,
            danger_left: until.saturating_sub(now),
        }
    }

    fn verdict(&self, now: Duration) -> Verdict {
        if self.danger_until.is_some_and(|until| now < until) {
            return Verdict::Danger;
        }
        let silent = |at: Duration| now.saturating_sub(at) > self.settings.danger_stale_after;
        if self.detector_at.is_some_and(silent) {
            return Verdict::Blind;
        }
        match self.pose {
            Some((at, pose)) if now.saturating_sub(at) <= self.settings.stale_after => {
                let inside = self.settings.area.contains(pose.x, pose.y);
                if inside { Verdict::Drive } else { Verdict::Outside }
            }
            Some(_) | None => Verdict::NoPose,
        }
    }
}

fn towards(value: f64, target: f64, step_max: f64) -> f64 {
    value + (target - value).clamp(-step_max, step_max)
}

#[cfg(test)]
mod tests;
