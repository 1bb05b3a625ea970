//! Motion from wheel encoders and gyro.

use sdr_lab::device::WheelReading;
use sdr_lab::tunnel::Pose;
use serde::{Deserialize, Serialize};

/// Wheels slower than this stand, metres a second.
const STANDING_M_S: f64 = 0.004;
/// Wheels faster than this are a device that started anew, metres a second.
const WHEEL_MAX_M_S: f64 = 5.0;
/// How much of each standing reading goes into the gyro's bias: 1 s at 100 Hz.
const BIAS_SHARE: f64 = 0.01;
/// A gyro that turns more than this while the wheels stand is carried, not biased, rad/s.
const BIAS_MAX_RAD_S: f64 = 0.08;

/// How the rover moved for some time.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize, Deserialize)]
pub struct Motion {
    /// Mean speed ahead, metres a second.
    pub linear: f64,
    /// Mean rate of turn to the left, radians a second.
    pub angular: f64,
    /// For how long, seconds.
    pub seconds: f64,
}

impl Motion {
    /// The even motion that leads from one dead-reckoned pose to a later one; `None` when no
    /// time lies between. Samples lost on the way do no harm.
    pub fn between(from: &Pose, to: &Pose, seconds: f64) -> Option<Self> {
        if seconds.is_nan() || seconds <= 0.0 {
            return None;
        }
        let turned = sdr_lab::tunnel::wrap_angle(to.yaw - from.yaw);
        let way = from.distance_to(to.x, to.y);
        let middle = from.yaw + turned / 2.0;
        let ahead = (to.x - from.x) * middle.cos() + (to.y - from.y) * middle.sin();
        Some(Self { linear: way.copysign(ahead) / seconds, angular: turned / seconds, seconds })
    }
}

/// Turns readings of the wheels into motion.
#[derive(Debug, Clone, Serialize, Deserialize)]
pub struct Odometer {
    track_m: f64,
    last: Option<WheelReading>,
    gyro_bias: f64,
    standing_for: u32,
}

impl Odometer {
    /// An odometer for wheels `track_m` metres apart.
    pub fn new(track_m: f64) -> Self {
        Self { track_m, last: None, gyro_bias: 0.0, standing_for: 0 }
    }

    /// Takes a reading; the motion since the one before. `None` for the first, for one that
    /// is not newer, and for one of a device that began anew.
    pub fn handle(&mut self, reading: &WheelReading) -> Option<Motion> {
        let last = self.last.replace(*reading)?;
        let elapsed_ns = reading.stamp_ns.checked_sub(last.stamp_ns).filter(|&ns| ns > 0)?;
        let seconds = elapsed_ns as f64 / 1e9;
        let left = (reading.left_m - last.left_m) / seconds;
        let right = (reading.right_m - last.right_m) / seconds;
        let fastest = left.abs() + right.abs();
        if !reading.gyro_rad_s.is_finite() || fastest.is_nan() || fastest > WHEEL_MAX_M_S {
            return None;
        }
        if left.abs().max(right.abs()) < STANDING_M_S {
            self.learn_bias(reading.gyro_rad_s);
            return Some(Motion { linear: 0.0, angular: 0.0, seconds });
        }
        self.standing_for = 0;
        let by_wheels = (right - left) / self.track_m;
        let by_gyro = reading.gyro_rad_s - self.gyro_bias;
        // The gyro drifts, the wheels slip: most of the turn is the gyro's.
        let angular = 0.9 * by_gyro + 0.1 * by_wheels;
        Some(Motion { linear: (left + right) / 2.0, angular, seconds })
    }

    /// What the gyro says while nothing turns, radians a second.
    pub fn gyro_bias(&self) -> f64 {
        self.gyro_bias
    }

    /// The first readings count most, so that a short stand is enough.
    fn learn_bias(&mut self, gyro_rad_s: f64) {
        if gyro_rad_s.abs() < BIAS_MAX_RAD_S {
            self.standing_for = self.standing_for.saturating_add(1);
            let share = (1.0 / f64::from(self.standing_for)).max(BIAS_SHARE);
            self.gyro_bias += share * (gyro_rad_s - self.gyro_bias);
        }
    }
}

/// Motion added up, without any correction: a frame of its own that drifts.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize, Deserialize)]
pub struct DeadReckoning {
    /// The sum.
    pub pose: Pose,
}

impl DeadReckoning {
    /// Begins at a pose.
    pub fn new(pose: Pose) -> Self {
        Self { pose }
    }

    /// Adds a motion.
    pub fn advance(&mut self, motion: &Motion) -> Pose {
        self.pose = moved(&self.pose, motion);
        self.pose
    }
}

/// The pose after a motion: an arc, by its chord.
pub(super) fn moved(pose: &Pose, motion: &Motion) -> Pose {
    let turned = motion.angular * motion.seconds;
    let way = motion.linear * motion.seconds;
    let middle = pose.yaw + turned / 2.0;
    Pose::new(pose.x + way * middle.cos(), pose.y + way * middle.sin(), pose.yaw + turned)
}

#[cfg(test)]
mod odometer_tests {
    use super::*;

    fn reading(ms: u64, left_m: f64, right_m: f64, gyro_rad_s: f64) -> WheelReading {
        let stamp_ns = ms * 1_000_000;
        WheelReading { stamp_ns, left_m, right_m, gyro_rad_s, ..WheelReading::default() }
    }

    #[test]
    fn motion_is_what_encoders_and_gyro_agree_on() {
        let mut odometer = Odometer::new(0.34);
        assert_eq!(odometer.handle(&reading(0, 0.0, 0.0, 0.0)), None);

        let motion = odometer.handle(&reading(100, 0.028, 0.032, 0.118)).unwrap();

        assert!((motion.linear - 0.3).abs() < 1e-9 && (motion.seconds - 0.1).abs() < 1e-12);
        assert!((motion.angular - 0.118).abs() < 1e-3, "{motion:?}");
    }

    #[test]
    fn the_bias_is_learnt_while_standing() {
        let mut odometer = Odometer::new(0.34);
        for step in 0..50 {
            odometer.handle(&reading(step * 10, 0.0, 0.0, 0.012));
        }

        let motion = odometer.handle(&reading(500, 0.003, 0.003, 0.012)).unwrap();

        assert!((odometer.gyro_bias() - 0.012).abs() < 1e-9);
        assert!(motion.angular.abs() < 1e-9);
    }

    #[test]
    fn a_device_that_began_anew_or_repeats_itself_moves_nothing() {
        let mut odometer = Odometer::new(0.34);
        odometer.handle(&reading(0, 40.0, 40.0, 0.0));

        assert_eq!(odometer.handle(&reading(10, 0.0, 0.0, 0.0)), None);
        assert_eq!(odometer.handle(&reading(10, 0.1, 0.1, 0.0)), None);
        assert_eq!(odometer.handle(&reading(20, f64::NAN, 0.1, 0.0)), None);
    }

    #[test]
    fn motion_between_two_poses_leads_from_one_to_the_other() {
        let from = Pose::new(1.0, 2.0, 3.0);
        for (linear, angular) in [(0.4, 0.5), (-0.4, 0.5), (0.3, 0.0), (0.0, -1.0)] {
            let motion = Motion { linear, angular, seconds: 0.4 };
            let to = moved(&from, &motion);

            let found = Motion::between(&from, &to, 0.4).unwrap();

            assert!((found.linear - linear).abs() < 1e-9, "{found:?}");
            assert!((found.angular - angular).abs() < 1e-9, "{found:?}");
        }
        assert_eq!(Motion::between(&from, &from, 0.0), None);
    }
}
