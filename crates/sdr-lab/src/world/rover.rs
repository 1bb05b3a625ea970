//! A rover: two driven wheels with lag and slip, encoders and an inertial sensor.

use serde::{Deserialize, Serialize};

use crate::noise::Noise;
use crate::tunnel::{DangerousObject, HALF_WIDTH_M, LENGTH_M, Pose};

/// Between the wheels, metres.
pub const TRACK_M: f64 = 0.34;
/// Greatest speed ahead or back, metres a second.
pub const SPEED_MAX_M_S: f64 = 0.6;
/// Greatest rate of turn, radians a second.
pub const TURN_MAX_RAD_S: f64 = 1.5;
/// A rover stops when no command came for so long, nanoseconds.
pub const WATCHDOG_NS: u64 = 500_000_000;
/// From the middle of the rover to its rim, metres.
pub const RADIUS_M: f64 = 0.25;
/// Time constant of the motors, seconds.
const MOTOR_LAG_S: f64 = 0.12;
/// Slower than this is standing, metres a second.
const STANDING_M_S: f64 = 0.01;
/// Faster than this is driving, metres a second (or the same in the turn of a wheel).
const DRIVING_M_S: f64 = 0.05;

/// What the wheels are told.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Command {
    /// Speed ahead, metres a second; -10 to 10, the motors do at most 0.6.
    pub linear: f64,
    /// Rate of turn to the left, radians a second; -100 to 100, the motors do at most 1.5.
    pub angular: f64,
}

/// What encoders and inertial sensor say.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize, Deserialize)]
pub struct WheelReading {
    /// Monotonic clock of the machine, nanoseconds.
    pub stamp_ns: u64,
    /// Counts the readings of this device.
    pub sequence: u64,
    /// Way of the left wheel since the start by its encoder, metres.
    pub left_m: f64,
    /// Way of the right wheel since the start by its encoder, metres.
    pub right_m: f64,
    /// Rate of turn by the gyro (biased, noisy), radians a second.
    pub gyro_rad_s: f64,
    /// Acceleration ahead (noisy), metres a second squared.
    pub accel_x_m_s2: f64,
    /// Acceleration to the left (noisy), metres a second squared.
    pub accel_y_m_s2: f64,
}

/// Truth about one rover and its sensors.
#[derive(Debug, Clone)]
pub struct Rover {
    /// Where it is.
    pub pose: Pose,
    /// Speed ahead, metres a second.
    pub speed: f64,
    /// Rate of turn, radians a second.
    pub turn: f64,
    /// Way driven since the start, metres.
    pub distance_m: f64,
    /// How often it came to a stand after driving.
    pub stops: u32,
    /// Whether it drives now.
    pub driving: bool,
    command: Command,
    commanded_at_ns: Option<u64>,
    reading: WheelReading,
    slip: [f64; 2],
    gyro_bias: f64,
    noise: Noise,
}

impl Rover {
    /// A rover at rest.
    pub fn new(pose: Pose, mut noise: Noise) -> Self {
        let slip = [0, 1].map(|_| noise.normal(0.01));
        let gyro_bias = noise.normal(0.006);
        Self {
            pose,
            speed: 0.0,
            turn: 0.0,
            distance_m: 0.0,
            stops: 0,
            driving: false,
            command: Command::default(),
            commanded_at_ns: None,
            reading: WheelReading::default(),
            slip,
            gyro_bias,
            noise,
        }
    }

    /// Takes a command; it holds until the next one or until the watchdog ends it.
    pub fn handle_command(&mut self, now_ns: u64, command: Command) {
        self.command = command;
        self.commanded_at_ns = Some(now_ns);
    }

    /// Lets `seconds` pass.
    pub fn advance(&mut self, now_ns: u64, seconds: f64, object: Option<&DangerousObject>) {
        let wanted = self.command_in_force(now_ns);
        let follow = 1.0 - (-seconds / MOTOR_LAG_S).exp();
        let before = self.speed;
        self.speed += (wanted.linear - self.speed) * follow;
        self.turn += (wanted.angular - self.turn) * follow;
        let middle = self.pose.yaw + self.turn * seconds / 2.0;
        let way = self.speed * seconds;
        let x = self.pose.x + way * middle.cos();
        let y = self.pose.y + way * middle.sin();
        let yaw = self.pose.yaw + self.turn * seconds;
        if is_free(x, y) && !object.is_some_and(|object| object.touches(x, y, RADIUS_M)) {
            self.distance_m += way.abs();
            self.pose = Pose::new(x, y, yaw);
        } else {
            self.speed = 0.0;
            self.pose = Pose::new(self.pose.x, self.pose.y, yaw);
        }
        self.count_stops();
        self.sense(now_ns, seconds, (self.speed - before) / seconds);
    }

    /// Puts the rover where another one carries it; its sensors see the motion.
    pub fn carry(&mut self, now_ns: u64, seconds: f64, to: Pose) {
        let way = self.pose.distance_to(to.x, to.y);
        let ahead = self.pose.bearing_to(to.x, to.y).cos() >= 0.0;
        let before = self.speed;
        self.speed = if ahead { way } else { -way } / seconds;
        self.turn = crate::tunnel::wrap_angle(to.yaw - self.pose.yaw) / seconds;
        self.distance_m += way;
        self.pose = to;
        self.count_stops();
        self.sense(now_ns, seconds, (self.speed - before) / seconds);
    }

    /// What the sensors say now.
    pub fn reading(&self) -> WheelReading {
        self.reading
    }

    fn command_in_force(&self, now_ns: u64) -> Command {
        let fresh = |at: u64| now_ns.saturating_sub(at) < WATCHDOG_NS;
        if self.commanded_at_ns.is_some_and(fresh) {
            Command {
                linear: self.command.linear.clamp(-SPEED_MAX_M_S, SPEED_MAX_M_S),
                angular: self.command.angular.clamp(-TURN_MAX_RAD_S, TURN_MAX_RAD_S),
            }
        } else {
            Command::default()
        }
    }

    fn count_stops(&mut self) {
        let motion = self.speed.abs().max(self.turn.abs() * TRACK_M / 2.0);
        if motion > DRIVING_M_S {
            self.driving = true;
        } else if motion < STANDING_M_S && self.driving {
            self.driving = false;
            self.stops = self.stops.saturating_add(1);
        }
    }

    fn sense(&mut self, now_ns: u64, seconds: f64, acceleration: f64) {
        let root = seconds.sqrt();
        for side in &mut self.slip {
            // Slip wanders slowly about zero; about 2 % in all.
            *side += -*side * seconds / 5.0 + self.noise.normal(0.012) * root;
        }
        self.gyro_bias += self.noise.normal(0.000_3) * root;
        let half = self.turn * TRACK_M / 2.0;
        self.reading.left_m += (self.speed - half) * seconds * (1.0 + self.slip[0]);
        self.reading.right_m += (self.speed + half) * seconds * (1.0 + self.slip[1]);
        self.reading.gyro_rad_s = self.turn + self.gyro_bias + self.noise.normal(0.01);
        self.reading.accel_x_m_s2 = acceleration + self.noise.normal(0.05);
        self.reading.accel_y_m_s2 = self.speed * self.turn + self.noise.normal(0.05);
        self.reading.stamp_ns = now_ns;
    }
}

/// Whether a rover fits between the walls here.
fn is_free(x: f64, y: f64) -> bool {
    (RADIUS_M..=LENGTH_M - RADIUS_M).contains(&x) && y.abs() <= HALF_WIDTH_M - RADIUS_M
}

#[cfg(test)]
mod tests {
    use super::*;

    const STEP_S: f64 = 0.005;

    fn drive(rover: &mut Rover, command: Command, from_step: u64, steps: u64, again: bool) {
        for step in from_step..from_step + steps {
            let now_ns = step * 5_000_000;
            if again || step == from_step {
                rover.handle_command(now_ns, command);
            }
            rover.advance(now_ns, STEP_S, None);
        }
    }

    #[test]
    fn a_commanded_rover_drives_an_arc_and_its_encoders_nearly_agree() {
        let mut rover = Rover::new(Pose::new(5.0, 0.0, 0.0), Noise::new(1));

        drive(&mut rover, Command { linear: 0.3, angular: 0.1 }, 0, 1000, true);

        let way = (rover.reading.left_m + rover.reading.right_m) / 2.0;
        assert!((rover.distance_m - 1.46).abs() < 0.02, "{}", rover.distance_m);
        assert!((way - rover.distance_m).abs() < 0.1, "{way}");
        assert!((rover.pose.yaw - 0.488).abs() < 0.01, "{}", rover.pose.yaw);
    }

    #[test]
    fn without_commands_the_watchdog_stops_the_rover() {
        let mut rover = Rover::new(Pose::new(5.0, 0.0, 0.0), Noise::new(1));

        drive(&mut rover, Command { linear: 0.3, angular: 0.0 }, 0, 400, false);

        assert_eq!((rover.stops, rover.driving), (1, false));
        assert!(rover.distance_m < 0.16, "{}", rover.distance_m);
    }

    #[test]
    fn a_rover_can_turn_but_not_pass_at_the_wall_or_the_object() {
        let object = DangerousObject::at(6.0, 0.0);
        let mut rover = Rover::new(Pose::new(5.0, 0.0, 0.0), Noise::new(1));
        for step in 0..1200_u64 {
            let now_ns = step * 5_000_000;
            rover.handle_command(now_ns, Command { linear: 0.5, angular: 0.0 });
            rover.advance(now_ns, STEP_S, Some(&object));
        }

        assert!(rover.pose.x < 5.46 && rover.pose.x > 5.4, "{}", rover.pose.x);
        assert!(rover.stops >= 1 && !rover.driving);
    }
}
