//! The truth that the threads of a world share.

use std::collections::VecDeque;
use std::sync::{Mutex, MutexGuard, PoisonError};
use std::time::Duration;

use serde::Serialize;

use super::config::{Appearance, Drive, RoverConfig};
use super::rover::{Command, Rover};
use crate::noise::Noise;
use crate::radio::RadioModel;
use crate::tunnel::{DangerousObject, HALF_WIDTH_M, LENGTH_M, Pose};

/// Most arrival times kept for a rover: over half an hour at 50 Hz.
const COMMANDS_MAX: usize = 100_000;
/// From here on a fisheye shows the object too small to tell, metres.
const VIEW_RANGE_M: f64 = 7.0;

/// Now, by the monotonic clock that all processes of the machine share, nanoseconds.
pub fn monotonic_ns() -> u64 {
    let now = rustix::time::clock_gettime(rustix::time::ClockId::Monotonic);
    let seconds = u64::try_from(now.tv_sec).unwrap_or(0);
    seconds * 1_000_000_000 + u64::try_from(now.tv_nsec).unwrap_or(0)
}

/// What the threads share.
#[derive(Debug)]
pub(super) struct Shared {
    pub(super) started_ns: u64,
    truth: Mutex<Truth>,
}

impl Shared {
    pub(super) fn new(seed: u64, rovers: Vec<RoverConfig>, schedule: Vec<Appearance>) -> Self {
        let body = |(index, config): (usize, RoverConfig)| {
            let stream = index as u64 * 2;
            Body {
                rover: Rover::new(config.start, Noise::stream(seed, stream)),
                radio: RadioModel::new(
                    config.rssi_dbm,
                    config.rssi_sigma_db,
                    Noise::stream(seed, stream + 1),
                ),
                config,
                commands: VecDeque::new(),
            }
        };
        let bodies = rovers.into_iter().enumerate().map(body).collect();
        let truth = Truth { bodies, object: None, schedule, next_visit: 0, visit_until: None };
        Self { started_ns: monotonic_ns(), truth: Mutex::new(truth) }
    }

    /// The truth; a thread that panicked leaves it usable, for it is whole after each step.
    pub(super) fn truth(&self) -> MutexGuard<'_, Truth> {
        self.truth.lock().unwrap_or_else(PoisonError::into_inner)
    }

    pub(super) fn elapsed(&self) -> Duration {
        Duration::from_nanos(monotonic_ns().saturating_sub(self.started_ns))
    }
}

/// All that is so.
#[derive(Debug)]
pub(super) struct Truth {
    pub(super) bodies: Vec<Body>,
    pub(super) object: Option<DangerousObject>,
    schedule: Vec<Appearance>,
    next_visit: usize,
    visit_until: Option<Duration>,
}

/// One robot's body.
#[derive(Debug)]
pub(super) struct Body {
    pub(super) config: RoverConfig,
    pub(super) rover: Rover,
    pub(super) radio: RadioModel,
    commands: VecDeque<u64>,
}

impl Body {
    /// Takes a command that arrived.
    pub(super) fn handle_command(&mut self, now_ns: u64, command: Command) {
        if self.commands.len() == COMMANDS_MAX {
            self.commands.pop_front();
        }
        self.commands.push_back(now_ns);
        self.rover.handle_command(now_ns, command);
    }

    /// When commands arrived, oldest first.
    pub(super) fn commands(&self) -> &VecDeque<u64> {
        &self.commands
    }
}

impl Truth {
    /// Lets a step of time pass for everything.
    pub(super) fn advance(&mut self, now_ns: u64, elapsed: Duration, seconds: f64) {
        self.keep_schedule(elapsed);
        let object = self.object;
        for body in &mut self.bodies {
            if body.config.drive == Drive::Commanded {
                body.rover.advance(now_ns, seconds, object.as_ref());
            }
        }
        for index in 0..self.bodies.len() {
            if let Drive::Station { leader, offset } = &self.bodies[index].config.drive
                && let Some(leader) = self.find(leader)
            {
                let pose = self.bodies[leader].rover.pose.at_offset(offset);
                let x = pose.x.clamp(0.2, LENGTH_M - 0.2);
                let y = pose.y.clamp(0.2 - HALF_WIDTH_M, HALF_WIDTH_M - 0.2);
                let to = Pose::new(x, y, pose.yaw);
                self.bodies[index].rover.carry(now_ns, seconds, to);
            }
        }
    }

    /// Where a robot is in the list.
    pub(super) fn find(&self, robot: &str) -> Option<usize> {
        self.bodies.iter().position(|body| body.config.name == robot)
    }

    /// Puts the object before a robot, inside the tunnel.
    pub(super) fn place_ahead(&mut self, index: usize, distance_m: f64) {
        let place = self.bodies[index].rover.pose.at_offset(&Pose::new(distance_m, 0.0, 0.0));
        let half = DangerousObject::EDGE_M / 2.0;
        self.object = Some(DangerousObject::at(
            place.x.clamp(half, LENGTH_M - half),
            place.y.clamp(half - HALF_WIDTH_M, HALF_WIDTH_M - half),
        ));
    }

    /// Everything a watcher may want.
    pub(super) fn snapshot(&self, elapsed: Duration) -> Snapshot {
        let rovers = self.bodies.iter().map(|body| self.snapshot_of(body, elapsed)).collect();
        Snapshot { elapsed, object: self.object, rovers }
    }

    fn snapshot_of(&self, body: &Body, elapsed: Duration) -> RoverSnapshot {
        let pose = body.rover.pose;
        let distance = self.object.map(|object| pose.distance_to(object.x, object.y));
        let ahead = self.object.is_some_and(|object| {
            pose.bearing_to(object.x, object.y).abs() < std::f64::consts::FRAC_PI_2
        });
        RoverSnapshot {
            robot: body.config.name.clone(),
            pose,
            speed_m_s: body.rover.speed,
            turn_rad_s: body.rover.turn,
            distance_m: body.rover.distance_m,
            stops: body.rover.stops,
            driving: body.rover.driving,
            object_distance_m: distance,
            object_visible: ahead && distance.is_some_and(|distance| distance < VIEW_RANGE_M),
            rssi_dbm: body.radio.mean_dbm(elapsed),
            commands_count: body.commands.len(),
        }
    }

    fn keep_schedule(&mut self, elapsed: Duration) {
        if self.visit_until.is_some_and(|until| elapsed >= until) {
            self.visit_until = None;
            self.object = None;
        }
        let Some(visit) = self.schedule.get(self.next_visit).cloned() else { return };
        if elapsed >= visit.from {
            self.next_visit += 1;
            if let Some(index) = self.find(&visit.ahead_of) {
                self.place_ahead(index, visit.distance_m);
                self.visit_until = Some(visit.until);
            }
        }
    }
}

/// The truth at one moment.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Snapshot {
    /// Since the start of the world.
    pub elapsed: Duration,
    /// The dangerous object, when it is there.
    pub object: Option<DangerousObject>,
    /// All robots, in the order of the configuration.
    pub rovers: Vec<RoverSnapshot>,
}

impl Snapshot {
    /// One robot's part.
    pub fn rover(&self, robot: &str) -> Option<&RoverSnapshot> {
        self.rovers.iter().find(|rover| rover.robot == robot)
    }
}

/// The truth about one rover.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct RoverSnapshot {
    /// Whose body.
    pub robot: String,
    /// Where it is.
    pub pose: Pose,
    /// Speed ahead, metres a second.
    pub speed_m_s: f64,
    /// Rate of turn, radians a second.
    pub turn_rad_s: f64,
    /// Way driven since the start, metres.
    pub distance_m: f64,
    /// How often it came to a stand after driving.
    pub stops: u32,
    /// Whether it drives now.
    pub driving: bool,
    /// Metres to the object, when it is there.
    pub object_distance_m: Option<f64>,
    /// Whether the object is ahead and near enough for the fisheye to show it.
    pub object_visible: bool,
    /// Level of its radio without noise, dBm.
    pub rssi_dbm: f64,
    /// Commands its wheels have got (the newest 100,000 are kept).
    pub commands_count: usize,
}

/// Pauses of a command stream.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
pub struct CommandGaps {
    /// Pauses looked at: one less than the commands.
    pub count: usize,
    /// The middle one, nanoseconds.
    pub median_ns: u64,
    /// The longest one, nanoseconds.
    pub longest_ns: u64,
    /// When the longest one began (arrival of the command before it), monotonic nanoseconds.
    pub longest_from_ns: u64,
}

impl CommandGaps {
    /// The pauses that overlap `from_ns` to `until_ns`; `None` when there is none.
    pub(super) fn between(times: &VecDeque<u64>, from_ns: u64, until_ns: u64) -> Option<Self> {
        let pairs = times.iter().zip(times.iter().skip(1));
        let mut gaps: Vec<(u64, u64)> = pairs
            .filter(|&(before, after)| *after >= from_ns && *before <= until_ns)
            .map(|(before, after)| (after - before, *before))
            .collect();
        gaps.sort_unstable();
        let &(longest_ns, longest_from_ns) = gaps.last()?;
        let median_ns = gaps[gaps.len() / 2].0;
        Some(Self { count: gaps.len(), median_ns, longest_ns, longest_from_ns })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_longest_gap_in_a_window_is_found_with_its_start() {
        let times: VecDeque<u64> = [0, 20, 40, 200, 220, 240, 900].into();

        let gaps = CommandGaps::between(&times, 30, 230).unwrap();

        assert_eq!((gaps.count, gaps.longest_ns, gaps.longest_from_ns), (4, 160, 40));
        assert_eq!(gaps.median_ns, 20);
        assert_eq!(CommandGaps::between(&times, 901, 950), None);
    }

    #[test]
    fn the_object_comes_and_goes_by_its_schedule() {
        let visit = Appearance {
            from: Duration::from_secs(2),
            until: Duration::from_secs(4),
            ahead_of: "robot-1".to_owned(),
            distance_m: 3.0,
        };
        let rover = RoverConfig::new("robot-1", Pose::new(5.0, 0.0, 0.0));
        let shared = Shared::new(1, vec![rover], vec![visit]);
        let mut truth = shared.truth();
        let mut seen = |ms: u64| {
            truth.advance(ms * 1_000_000, Duration::from_millis(ms), 0.005);
            truth.snapshot(Duration::from_millis(ms)).rovers[0].object_visible
        };

        assert!(!seen(1999));
        assert!(seen(2000));
        assert!(seen(3999));
        assert!(!seen(4000));
        assert!(!seen(9000));
    }
}
