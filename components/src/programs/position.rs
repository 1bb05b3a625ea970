//! `PositionEstimationRTC`: wheels and gyro carry the estimate, pictures correct it.

use sdr_component::message::{
    builtin_interfaces::Time,
    geometry_msgs::{Point, Quaternion},
    nav_msgs::Odometry,
    sensor_msgs::Image,
};
use sdr_component::{Component, ComponentError, Context, InPort, OutPort, Outcome, Setup};
use sdr_core::order::Token;
use sdr_lab::optics::Lens;
use sdr_lab::tunnel::Pose;

use super::anomaly::view_of;
use super::{BODY_FRAME, MAP_FRAME};
use crate::estimate::{Estimator, Localizer, Motion, Spread};
use crate::vision::find_landmarks;

/// How well a given start is believed.
const START_SPREAD: Spread = Spread { x: 0.2, y: 0.2, yaw: 0.1 };
/// A picture older than this by the newest motion has another clock, nanoseconds.
const AGE_MAX_NS: u64 = 1_000_000_000;
/// Places of x, y and heading in a covariance of ROS 2.
const AXES: [usize; 3] = [0, 1, 5];

/// Says where the rover is.
#[derive(Debug)]
pub struct PositionEstimation {
    image: InPort<Image>,
    wheels: InPort<Odometry>,
    odometry: OutPort<Odometry>,
    lens: Lens,
    start: Option<Pose>,
    localizer: Localizer,
    /// The last motion: whose it was, when, and where in its own frame.
    before: Option<Before>,
    motion: Motion,
}

#[derive(Debug)]
struct Before {
    token: Option<Token>,
    stamp_ns: u64,
    pose: Pose,
}

impl Component for PositionEstimation {
    const NAME: &'static str = "position";
    const ABOUT: &'static str = "Says where the rover is, by wheels, gyro and landmarks.";

    fn new(setup: &mut Setup) -> Result<Self, ComponentError> {
        let about = "[x, y, yaw] where it is believed to begin, m and rad; empty to find out";
        let start = match setup.parameter("start", Vec::<f64>::new(), about)?.as_slice() {
            [] => None,
            [x, y, yaw] => Some(Pose::new(*x, *y, *yaw)),
            other => {
                let found = other.len();
                let reason = format!("parameter `start` has {found} numbers; allowed: 0 or 3");
                return Err(ComponentError::other(reason));
            }
        };
        let about = "full width of the camera's pictures, degrees";
        let degrees = setup.parameter_within("camera_hfov_deg", 70.0, 10.0..=150.0, about)?;
        Ok(Self {
            image: setup.input("image")?,
            wheels: setup.input("wheels")?,
            odometry: setup.output("odometry")?,
            lens: Lens::Perspective { hfov_rad: degrees.to_radians() },
            start,
            localizer: Localizer::lost(),
            before: None,
            motion: Motion::default(),
        })
    }

    fn on_activated(&mut self, _: &mut Context<'_>) -> Outcome {
        self.localizer = match self.start {
            Some(pose) => Localizer::at(pose, START_SPREAD),
            None => Localizer::lost(),
        };
        self.before = None;
        self.motion = Motion::default();
        Ok(())
    }

    fn on_execute(&mut self, context: &mut Context<'_>) -> Outcome {
        self.take_motions()?;
        self.take_pictures()?;
        let stamp_ns = self.before.as_ref().map_or(context.now_ns(), |before| before.stamp_ns);
        self.odometry.send(&self.odometry_at(stamp_ns))?;
        Ok(())
    }
}

impl PositionEstimation {
    fn take_motions(&mut self) -> Outcome {
        while let Some(sample) = self.wheels.receive() {
            let odometry = sample.message()?;
            let position = odometry.pose.pose.position;
            let yaw = odometry.pose.pose.orientation.yaw();
            let pose = Pose::new(position.x, position.y, yaw);
            let stamp_ns = odometry.header.stamp.as_nanos();
            let now = Before { token: sample.token(), stamp_ns, pose };
            // Another activation of the controller has another frame.
            if let Some(before) = self.before.take_if(|before| before.token == now.token)
                && let Some(elapsed_ns) = stamp_ns.checked_sub(before.stamp_ns)
            {
                let seconds = std::time::Duration::from_nanos(elapsed_ns).as_secs_f64();
                if let Some(motion) = Motion::between(&before.pose, &pose, seconds) {
                    self.localizer.handle_motion(&motion);
                    self.motion = motion;
                }
            }
            self.before = Some(now);
        }
        Ok(())
    }

    fn take_pictures(&mut self) -> Outcome {
        while let Some(sample) = self.image.receive() {
            let image = sample.message()?;
            let sightings = find_landmarks(&view_of(&image)?, &self.lens);
            let age_s = self.before.as_ref().map_or(0.0, |before| {
                let age_ns = before.stamp_ns.saturating_sub(image.stamp.as_nanos());
                let age_ns = if age_ns > AGE_MAX_NS { 0 } else { age_ns };
                std::time::Duration::from_nanos(age_ns).as_secs_f64()
            });
            self.localizer.handle_sightings(&sightings, age_s);
        }
        Ok(())
    }

    /// The estimate; while lost the pose is NaN, which consumers take for none.
    fn odometry_at(&self, stamp_ns: u64) -> Odometry {
        let mut odometry =
            Odometry { child_frame_id: BODY_FRAME.to_owned(), ..Odometry::default() };
        odometry.header.stamp = Time::from_nanos(stamp_ns);
        odometry.header.frame_id = MAP_FRAME.to_owned();
        match self.localizer.estimator() {
            Some(estimator) => {
                let Pose { x, y, yaw } = estimator.pose();
                odometry.pose.pose.position = Point { x, y, z: 0.0 };
                odometry.pose.pose.orientation = Quaternion::from_yaw(yaw);
                odometry.pose.covariance = covariance_of(estimator);
            }
            None => {
                odometry.pose.pose.position = Point { x: f64::NAN, y: f64::NAN, z: f64::NAN };
            }
        }
        odometry.twist.twist.linear.x = self.motion.linear;
        odometry.twist.twist.angular.z = self.motion.angular;
        odometry
    }
}

fn covariance_of(estimator: &Estimator) -> [f64; 36] {
    let mut covariance = [0.0; 36];
    for (row, values) in AXES.iter().zip(estimator.covariance()) {
        for (column, value) in AXES.iter().zip(values) {
            covariance[row * 6 + column] = value;
        }
    }
    covariance
}
