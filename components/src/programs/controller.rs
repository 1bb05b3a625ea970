//! `REDControllerRTC`: drives along a path, and stops on order.

use std::time::Duration;

use sdr_component::message::{
    builtin_interfaces::Time,
    geometry_msgs::{Point, Quaternion, Twist, Vector3},
    nav_msgs::Odometry,
    std_msgs::Bool,
};
use sdr_component::{Component, ComponentError, Context, InPort, OutPort, Outcome, Setup};
use sdr_lab::tunnel::Pose;

use super::wheels::{Measured, Wheels};
use super::{BODY_FRAME, ODOMETRY_FRAME};
use crate::control::{After, Area, Controller, Path, Settings, Verdict};

/// Moves the rover.
#[derive(Debug)]
pub struct MotionController {
    danger: InPort<Bool>,
    odometry: InPort<Odometry>,
    measured: OutPort<Odometry>,
    command: OutPort<Twist>,
    wheels: Wheels,
    settings: Settings,
    path: Path,
    /// Made anew by each activation.
    controller: Option<Controller>,
    verdict: Option<Verdict>,
}

impl Component for MotionController {
    const NAME: &'static str = "controller";
    const ABOUT: &'static str = "Drives along a path inside an area; stops for danger.";

    fn new(setup: &mut Setup) -> Result<Self, ComponentError> {
        let (settings, path) = parameters(setup)?;
        // Ranges are told now and not at the first activation.
        Controller::new(settings.clone(), path.clone())?;
        Ok(Self {
            danger: setup.input("danger")?,
            odometry: setup.input("odometry")?,
            measured: setup.output("wheels")?,
            command: setup.output("command")?.with_safe(&Twist::default())?,
            wheels: Wheels::new(setup.device("wheels")?),
            settings,
            path,
            controller: None,
            verdict: None,
        })
    }

    fn on_initialize(&mut self, _: &mut Context<'_>) -> Outcome {
        self.wheels.connect()
    }

    fn on_activated(&mut self, context: &mut Context<'_>) -> Outcome {
        self.controller = Some(Controller::new(self.settings.clone(), self.path.clone())?);
        self.verdict = None;
        self.wheels.start(context.now_ns())
    }

    fn on_execute(&mut self, context: &mut Context<'_>) -> Outcome {
        let Some(controller) = &mut self.controller else { return Ok(()) };
        let now = Duration::from_nanos(context.now_ns());
        while let Some(sample) = self.danger.receive() {
            controller.handle_danger(now, sample.message()?.data);
        }
        while let Some(sample) = self.odometry.receive() {
            let pose = sample.message()?.pose.pose;
            let yaw = pose.orientation.yaw();
            // What is not finite is no pose: the estimator is lost.
            let is_known = pose.position.x.is_finite() && pose.position.y.is_finite();
            if is_known && yaw.is_finite() {
                controller.handle_pose(now, Pose::new(pose.position.x, pose.position.y, yaw));
            }
        }
        let order = controller.order(now);
        if self.verdict.replace(order.verdict) != Some(order.verdict) {
            context.log(format_args!("controller: {:?}", order.verdict));
        }
        self.wheels.order(order.linear, order.angular)?;
        self.command.send(&Twist {
            linear: Vector3 { x: order.linear, y: 0.0, z: 0.0 },
            angular: Vector3 { x: 0.0, y: 0.0, z: order.angular },
        })?;
        if let Some(measured) = self.wheels.measure(context.now_ns())? {
            self.measured.send(&odometry_of(&measured))?;
        }
        Ok(())
    }

    fn on_deactivated(&mut self, _: &mut Context<'_>) -> Outcome {
        self.controller = None;
        self.wheels.order(0.0, 0.0)
    }

    fn on_aborting(&mut self, _: &mut Context<'_>) -> Outcome {
        self.controller = None;
        self.wheels.order(0.0, 0.0)
    }

    fn on_reset(&mut self, _: &mut Context<'_>) -> Outcome {
        self.wheels.connect()
    }

    fn on_finalize(&mut self, _: &mut Context<'_>) -> Outcome {
        self.wheels.disconnect();
        Ok(())
    }
}

fn parameters(setup: &mut Setup) -> Result<(Settings, Path), ComponentError> {
    let default_area = vec![vec![0.0, -2.0], vec![30.0, -2.0], vec![30.0, 2.0], vec![0.0, 2.0]];
    let corners = setup.parameter("area", default_area, "where the rover may be, corners, m")?;
    let mut settings = Settings::in_area(Area::new(points("area", &corners)?)?);
    let usual = settings.guide.speed_max;
    settings.guide.speed_max = setup.parameter("speed_max", usual, "m/s")?;
    let hold = settings.danger_hold.as_secs_f64();
    let about = "how much longer danger lasts than it was seen, s";
    let hold = setup.parameter_within("danger_hold_s", hold, 0.0..=60.0, about)?;
    settings.danger_hold = Duration::from_secs_f64(hold);
    let stale = settings.stale_after.as_secs_f64();
    let about = "a pose older than this is none, s";
    let stale = setup.parameter_within("stale_after_s", stale, 0.05..=10.0, about)?;
    settings.stale_after = Duration::from_secs_f64(stale);
    let stale = settings.danger_stale_after.as_secs_f64();
    let about = "a detector that was heard and is silent for longer is blind: stop, s";
    let stale = setup.parameter_within("danger_stale_after_s", stale, 0.05..=10.0, about)?;
    settings.danger_stale_after = Duration::from_secs_f64(stale);
    let about = "points to drive along, round and round, m; empty for the tunnel's two lanes";
    let way = setup.parameter("path", Vec::<Vec<f64>>::new(), about)?;
    let path = if way.is_empty() {
        Path::tunnel_loop()
    } else {
        Path::new(points("path", &way)?, After::Loop)?
    };
    Ok((settings, path))
}

fn points(name: &str, pairs: &[Vec<f64>]) -> Result<Vec<[f64; 2]>, ComponentError> {
    let point = |(index, pair): (usize, &Vec<f64>)| {
        <[f64; 2]>::try_from(pair.as_slice()).map_err(|_| {
            let found = pair.len();
            ComponentError::other(format!(
                "parameter `{name}`: point {index} has {found} numbers; allowed: [x, y]"
            ))
        })
    };
    pairs.iter().enumerate().map(point).collect()
}

fn odometry_of(measured: &Measured) -> Odometry {
    let mut odometry = Odometry { child_frame_id: BODY_FRAME.to_owned(), ..Odometry::default() };
    odometry.header.stamp = Time::from_nanos(measured.stamp_ns);
    odometry.header.frame_id = ODOMETRY_FRAME.to_owned();
    let Pose { x, y, yaw } = measured.pose;
    odometry.pose.pose.position = Point { x, y, z: 0.0 };
    odometry.pose.pose.orientation = Quaternion::from_yaw(yaw);
    odometry.twist.twist.linear.x = measured.motion.linear;
    odometry.twist.twist.angular.z = measured.motion.angular;
    odometry
}
