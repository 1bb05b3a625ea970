//! An extended Kalman filter over position and heading.

use sdr_lab::tunnel::{Pose, wrap_angle};
use serde::{Deserialize, Serialize};

use super::odometer::{Motion, moved};

/// Squared Mahalanobis distance beyond which a bearing is not believed: 1 in 400 true ones.
const GATE: f64 = 9.0;
/// So many refusals more than half the acceptances put the estimate, not the bearings, in doubt.
const DOUBT_MAX: f64 = 12.0;
/// Longest age of a bearing, seconds; older ones are of no use.
const AGE_MAX_S: f64 = 1.0;

type Matrix = [[f64; 3]; 3];

/// Standard deviations of a pose.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct Spread {
    /// Of x, metres.
    pub x: f64,
    /// Of y, metres.
    pub y: f64,
    /// Of the heading, radians.
    pub yaw: f64,
}

/// A bearing to a place of the map.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Observation {
    /// The place: along the tunnel, metres.
    pub x: f64,
    /// The place: to the left, metres.
    pub y: f64,
    /// Angle to it, radians, positive to the left.
    pub bearing: f64,
    /// Standard deviation of the angle, radians.
    pub sigma: f64,
    /// How long ago the picture was taken, by the newest motion, seconds; at most 1.
    pub age_s: f64,
}

/// What became of an observation.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Correction {
    /// The estimate moved.
    Accepted {
        /// Squared Mahalanobis distance.
        distance: f64,
    },
    /// Too far from what was expected; the estimate did not move.
    Refused {
        /// Squared Mahalanobis distance.
        distance: f64,
    },
    /// Not a number, no spread, or too old; nothing changed.
    Senseless,
}

/// The estimate; it may be saved and loaded whole.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Estimator {
    pose: Pose,
    covariance: Matrix,
    motion: Motion,
    doubt: f64,
    accepted: u64,
    refused: u64,
}

impl Estimator {
    /// Begins where the rover is believed to be.
    pub fn new(pose: Pose, spread: Spread) -> Self {
        let mut covariance = [[0.0; 3]; 3];
        covariance[0][0] = spread.x.powi(2);
        covariance[1][1] = spread.y.powi(2);
        covariance[2][2] = spread.yaw.powi(2);
        let motion = Motion::default();
        Self { pose, covariance, motion, doubt: 0.0, accepted: 0, refused: 0 }
    }

    /// Moves the estimate; a motion that is not finite is left out.
    pub fn predict(&mut self, motion: &Motion) {
        let Motion { linear, angular, seconds } = *motion;
        if !(linear.is_finite() && angular.is_finite() && seconds > 0.0 && seconds.is_finite()) {
            return;
        }
        let middle = self.pose.yaw + angular * seconds / 2.0;
        let (sin, cos) = middle.sin_cos();
        let way = linear * seconds;
        let jacobian = [[1.0, 0.0, -way * sin], [0.0, 1.0, way * cos], [0.0, 0.0, 1.0]];
        self.covariance = product(&product(&jacobian, &self.covariance), &transposed(&jacobian));
        // Variances grow with the way, not with the rate of the readings: slip of 4 % per root
        // metre along, a little sideways, a gyro that wanders.
        let along = 0.04_f64.powi(2) * way.abs();
        let aside = 0.01_f64.powi(2) * way.abs();
        self.covariance[0][0] += cos * cos * along + sin * sin * aside;
        self.covariance[1][1] += sin * sin * along + cos * cos * aside;
        self.covariance[0][1] += sin * cos * (along - aside);
        self.covariance[1][0] += sin * cos * (along - aside);
        self.covariance[2][2] +=
            0.01_f64.powi(2) * seconds + 0.03_f64.powi(2) * (angular * seconds).abs();
        self.pose = moved(&self.pose, motion);
        self.motion = *motion;
    }

    /// Corrects the estimate by a bearing, if it is believable.
    pub fn correct(&mut self, seen: &Observation) -> Correction {
        let finite = [seen.x, seen.y, seen.bearing].iter().all(|value| value.is_finite());
        if !finite
            || seen.sigma.is_nan()
            || seen.sigma <= 0.0
            || !(0.0..=AGE_MAX_S).contains(&seen.age_s)
        {
            return Correction::Senseless;
        }
        let back = Motion { seconds: -seen.age_s, ..self.motion };
        let then = moved(&self.pose, &back);
        let (dx, dy) = (seen.x - then.x, seen.y - then.y);
        let square = (dx * dx + dy * dy).max(0.01);
        let jacobian = [dy / square, -dx / square, -1.0];
        let spread = times(&self.covariance, &jacobian);
        let variance = dot(&jacobian, &spread) + seen.sigma.powi(2);
        let surprise = wrap_angle(seen.bearing - then.bearing_to(seen.x, seen.y));
        let distance = surprise * surprise / variance;
        if distance > GATE {
            self.count_refusal();
            return Correction::Refused { distance };
        }
        self.doubt = (self.doubt - 0.5).max(0.0);
        self.accepted += 1;
        let gain = spread.map(|value| value / variance);
        self.pose = Pose::new(
            self.pose.x + gain[0] * surprise,
            self.pose.y + gain[1] * surprise,
            self.pose.yaw + gain[2] * surprise,
        );
        self.settle(&gain, &jacobian, seen.sigma.powi(2));
        Correction::Accepted { distance }
    }

    /// The estimate.
    pub fn pose(&self) -> Pose {
        self.pose
    }

    /// How well it is known.
    pub fn spread(&self) -> Spread {
        let [x, y, yaw] = [0, 1, 2].map(|i| self.covariance[i][i].max(0.0).sqrt());
        Spread { x, y, yaw }
    }

    /// Covariance of x, y and heading, row by row.
    pub fn covariance(&self) -> [[f64; 3]; 3] {
        self.covariance
    }

    /// Bearings believed and refused so far.
    pub fn counts(&self) -> (u64, u64) {
        (self.accepted, self.refused)
    }

    /// Joseph's form: stays symmetric and positive whatever the rounding.
    fn settle(&mut self, gain: &[f64; 3], jacobian: &[f64; 3], variance: f64) {
        let mut rest = [[0.0; 3]; 3];
        for row in 0..3 {
            for column in 0..3 {
                let one = f64::from(u8::from(row == column));
                rest[row][column] = one - gain[row] * jacobian[column];
            }
        }
        self.covariance = product(&product(&rest, &self.covariance), &transposed(&rest));
        for row in 0..3 {
            for column in 0..3 {
                self.covariance[row][column] += gain[row] * gain[column] * variance;
            }
        }
    }

    /// Doubt widens the estimate until bearings are believed again.
    fn count_refusal(&mut self) {
        self.refused += 1;
        self.doubt += 1.0;
        if self.doubt >= DOUBT_MAX {
            self.doubt = 0.0;
            let widen = |variance: f64, most: f64| (variance * 4.0).clamp(most / 10.0, most);
            let [x, y, yaw] =
                [(0, 25.0), (1, 1.0), (2, 1.0)].map(|(i, most)| widen(self.covariance[i][i], most));
            self.covariance = [[x, 0.0, 0.0], [0.0, y, 0.0], [0.0, 0.0, yaw]];
        }
    }
}

fn product(one: &Matrix, two: &Matrix) -> Matrix {
    let columns = transposed(two);
    one.map(|row| [0, 1, 2].map(|column| dot(&row, &columns[column])))
}

fn transposed(matrix: &Matrix) -> Matrix {
    [0, 1, 2].map(|row| [0, 1, 2].map(|column| matrix[column][row]))
}

fn times(matrix: &Matrix, vector: &[f64; 3]) -> [f64; 3] {
    matrix.map(|row| dot(&row, vector))
}

fn dot(one: &[f64; 3], two: &[f64; 3]) -> f64 {
    one[0] * two[0] + one[1] * two[1] + one[2] * two[2]
}
