//! A path and the way to follow it: pure pursuit.

use sdr_lab::tunnel::{LENGTH_M, Pose};

/// Most points of a path.
const POINTS_MAX: usize = 10_000;
/// Farther from the path than this, the nearest point is looked for anew, metres.
const ASTRAY_M: f64 = 1.2;
/// The nearest point is looked for this far behind the last one, metres.
const BEHIND_M: f64 = 0.3;
/// And this far ahead, metres: never as far as the other lane of a loop.
const AHEAD_M: f64 = 1.0;
/// The end is reached when it is so near, metres.
const REACHED_M: f64 = 0.05;

/// What comes after the last point.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum After {
    /// The first point again.
    Loop,
    /// Nothing: stop there.
    Stop,
}

/// A line of points to drive along.
#[derive(Debug, Clone, PartialEq)]
pub struct Path {
    points: Vec<[f64; 2]>,
    /// Way from the first point to each, metres.
    marks: Vec<f64>,
    after: After,
}

/// Points that make no path.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum PathError {
    /// Too few or too many.
    #[error("path has {found} points, allowed are 2 to 10000")]
    Points {
        /// How many.
        found: usize,
    },
    /// Not a number, or no farther than the point before.
    #[error("path: point {index} is not finite or lies on the one before it")]
    Point {
        /// Which point, from 0.
        index: usize,
    },
}

impl Path {
    /// A path through points; a loop goes back to the first by itself.
    pub fn new(mut points: Vec<[f64; 2]>, after: After) -> Result<Self, PathError> {
        if !(2..=POINTS_MAX).contains(&points.len()) {
            return Err(PathError::Points { found: points.len() });
        }
        if after == After::Loop {
            points.push(points[0]);
        }
        let mut marks = vec![0.0];
        for (index, pair) in points.windows(2).enumerate() {
            let way = (pair[1][0] - pair[0][0]).hypot(pair[1][1] - pair[0][1]);
            if !way.is_finite() || way < 1e-6 {
                return Err(PathError::Point { index: index + 1 });
            }
            marks.push(marks[index] + way);
        }
        Ok(Self { points, marks, after })
    }

    /// Up one lane of the lab's tunnel and down the other, round and round: lanes at -0.8 and
    /// 0.8 m, turns of 0.8 m.
    pub fn tunnel_loop() -> Self {
        let (radius, near, far) = (0.8, 2.0, LENGTH_M - 2.0);
        let arc = |middle: f64, from: f64| {
            (0..=12).map(move |step| {
                let angle = from + std::f64::consts::PI * f64::from(step) / 12.0;
                [middle + radius * angle.cos(), radius * angle.sin()]
            })
        };
        let quarter = std::f64::consts::FRAC_PI_2;
        let points = arc(far, -quarter).chain(arc(near, quarter)).collect();
        Self::new(points, After::Loop).expect("26 points, none on the one before it")
    }

    /// Its whole length, metres.
    pub fn length_m(&self) -> f64 {
        self.marks[self.marks.len() - 1]
    }

    /// The point after so many metres; before the start and after the end of a path that
    /// stops, its ends.
    pub fn point_at(&self, along_m: f64) -> [f64; 2] {
        let along = match self.after {
            After::Loop => along_m.rem_euclid(self.length_m()),
            After::Stop => along_m.clamp(0.0, self.length_m()),
        };
        let next = self.marks.partition_point(|&mark| mark <= along);
        let next = next.clamp(1, self.marks.len() - 1);
        let share = (along - self.marks[next - 1]) / (self.marks[next] - self.marks[next - 1]);
        let (a, b) = (self.points[next - 1], self.points[next]);
        [a[0] + share * (b[0] - a[0]), a[1] + share * (b[1] - a[1])]
    }

    /// The nearest point in a part of the path: metres along it, and metres away.
    fn nearest(&self, pose: &Pose, from_m: f64, until_m: f64) -> (f64, f64) {
        let steps = ((until_m - from_m) / 0.05).ceil().max(1.0);
        let mut best = (from_m, f64::INFINITY);
        let mut step = 0.0;
        while step <= steps {
            let along = from_m + (until_m - from_m) * step / steps;
            let [x, y] = self.point_at(along);
            let away = pose.distance_to(x, y);
            if away < best.1 {
                best = (along, away);
            }
            step += 1.0;
        }
        best
    }
}

/// How to follow a path.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct GuideSettings {
    /// Speed on straight parts, metres a second.
    pub speed_max: f64,
    /// Greatest rate of turn, radians a second.
    pub turn_max: f64,
    /// How far ahead the point lies that is aimed at, metres.
    pub lookahead_m: f64,
}

impl Default for GuideSettings {
    fn default() -> Self {
        Self { speed_max: 0.3, turn_max: 1.0, lookahead_m: 0.5 }
    }
}

/// Follows a path.
#[derive(Debug, Clone)]
pub struct Guide {
    path: Path,
    settings: GuideSettings,
    along_m: Option<f64>,
}

impl Guide {
    /// Joins the path at its nearest point.
    pub fn new(path: Path, settings: GuideSettings) -> Self {
        Self { path, settings, along_m: None }
    }

    /// Speed (m/s) and rate of turn (rad/s) wanted here; both 0 at the end of a path that
    /// stops.
    pub fn steer(&mut self, pose: &Pose) -> (f64, f64) {
        let along = self.locate(pose);
        let GuideSettings { speed_max, turn_max, lookahead_m } = self.settings;
        let left_m = match self.path.after {
            After::Loop => f64::INFINITY,
            After::Stop => self.path.length_m() - along,
        };
        if left_m < REACHED_M {
            return (0.0, 0.0);
        }
        let [x, y] = self.path.point_at(along + lookahead_m);
        let aside = pose.bearing_to(x, y);
        if aside.abs() > std::f64::consts::FRAC_PI_2 {
            return (0.0, (0.6 * turn_max).copysign(aside));
        }
        let curvature = 2.0 * aside.sin() / pose.distance_to(x, y).max(0.1);
        let speed = (speed_max * aside.cos().max(0.3)).min(left_m.max(0.1));
        let speed = speed.min(turn_max / curvature.abs().max(1e-9));
        (speed, speed * curvature)
    }

    /// Metres along the path, once it was joined.
    pub fn along_m(&self) -> Option<f64> {
        self.along_m
    }

    /// Goes on where another guide was on the same path; what is not on it is ignored.
    pub fn resume(&mut self, along_m: Option<f64>) {
        let on_path = |along: &f64| (0.0..=self.path.length_m()).contains(along);
        self.along_m = along_m.filter(on_path);
    }

    fn locate(&mut self, pose: &Pose) -> f64 {
        let near = self
            .along_m
            .map(|along| self.path.nearest(pose, along - BEHIND_M, along + AHEAD_M))
            .filter(|(_, away)| *away < ASTRAY_M);
        let length = self.path.length_m();
        let (along, _) = near.unwrap_or_else(|| self.path.nearest(pose, 0.0, length));
        let along = match self.path.after {
            After::Loop => along.rem_euclid(length),
            After::Stop => along.clamp(0.0, length),
        };
        self.along_m = Some(along);
        along
    }
}

#[cfg(test)]
mod tests {
    use sdr_lab::device::Command;
    use sdr_lab::noise::Noise;
    use sdr_lab::world::Rover;

    use super::*;

    fn drive(guide: &mut Guide, rover: &mut Rover, seconds: u64, mut watch: impl FnMut(&Rover)) {
        for step in 0..seconds * 200 {
            let now_ns = step * 5_000_000;
            if step % 4 == 0 {
                let (linear, angular) = guide.steer(&rover.pose);
                rover.handle_command(now_ns, Command { linear, angular });
            }
            rover.advance(now_ns, 0.005, None);
            watch(rover);
        }
    }

    #[test]
    fn a_rover_follows_the_lanes_of_the_tunnel_and_turns_round_without_a_stop() {
        let mut guide = Guide::new(Path::tunnel_loop(), GuideSettings::default());
        let mut rover = Rover::new(Pose::new(1.5, -0.8, 0.0), Noise::new(1));
        let (mut highest, mut lowest, mut backwards) = (0.0_f64, 30.0_f64, false);

        drive(&mut guide, &mut rover, 240, |rover| {
            let Pose { x, y, .. } = rover.pose;
            highest = highest.max(x);
            lowest = lowest.min(x);
            backwards |= rover.pose.yaw.cos() < -0.99;
            if (4.0..26.0).contains(&x) {
                assert!((y.abs() - 0.8).abs() < 0.05, "{:?}", rover.pose);
            }
        });

        assert!(highest > 28.6 && highest < 29.0, "{highest}");
        assert!(lowest > 1.1 && backwards, "{lowest}");
        assert_eq!(rover.stops, 0);
        assert!(rover.distance_m > 65.0, "{}", rover.distance_m);
    }

    #[test]
    fn a_path_that_stops_ends_at_its_last_point() {
        let path = Path::new(vec![[2.0, 0.0], [5.0, 0.0], [6.0, 1.0]], After::Stop).unwrap();
        let mut guide = Guide::new(path, GuideSettings::default());
        let mut rover = Rover::new(Pose::new(2.0, 0.0, 3.0), Noise::new(1));

        drive(&mut guide, &mut rover, 40, |_| {});

        assert!(rover.pose.distance_to(6.0, 1.0) < 0.15, "{:?}", rover.pose);
        assert!(!rover.driving);
    }

    #[test]
    fn points_that_make_no_path_are_refused() {
        let same = vec![[0.0, 0.0], [1.0, 0.0], [1.0, 0.0]];
        assert_eq!(Path::new(same, After::Stop), Err(PathError::Point { index: 2 }));
        assert_eq!(Path::new(vec![[0.0, 0.0]], After::Loop), Err(PathError::Points { found: 1 }));
        let infinite = vec![[0.0, 0.0], [f64::NAN, 0.0]];
        assert!(Path::new(infinite, After::Stop).is_err());
    }

    #[test]
    fn a_resumed_guide_stays_on_its_lane() {
        let mut guide = Guide::new(Path::tunnel_loop(), GuideSettings::default());
        let mut other = guide.clone();
        guide.steer(&Pose::new(10.0, 0.75, 3.1));
        other.resume(guide.along_m());

        assert_eq!(other.steer(&Pose::new(9.9, 0.1, 3.1)), guide.steer(&Pose::new(9.9, 0.1, 3.1)));
        other.resume(Some(1e9));
        assert_eq!(other.along_m(), None);
    }
}
