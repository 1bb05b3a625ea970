//! The five thoughts together, in virtual time: see, estimate, drive, stop, go on.

use std::time::Duration;

use sdr_components::control::{Area, Controller, Path, Settings, Verdict};
use sdr_components::estimate::{Estimator, Observation, Odometer, Spread};
use sdr_components::vision::{View, Vote, find_landmarks, find_red_box};
use sdr_lab::device::Command;
use sdr_lab::noise::Noise;
use sdr_lab::tunnel::{DangerousObject, Pose};
use sdr_lab::world::{Camera, Rover, Scene, TRACK_M};

const STEP_NS: u64 = 5_000_000;

/// One rover with everything on board.
struct Drive {
    now_ns: u64,
    rover: Rover,
    object: Option<DangerousObject>,
    fisheye: Camera,
    camera: Camera,
    vote: Vote,
    odometer: Odometer,
    estimator: Estimator,
    controller: Controller,
    verdict: Verdict,
}

impl Drive {
    fn new(corners: Vec<[f64; 2]>) -> Self {
        let start = Pose::new(1.5, -0.8, 0.0);
        let area = Area::new(corners).expect("the corners make an area");
        Self {
            now_ns: 0,
            rover: Rover::new(start, Noise::new(9)),
            object: None,
            fisheye: Camera::fisheye(),
            camera: Camera::perspective(),
            vote: Vote::default(),
            odometer: Odometer::new(TRACK_M),
            estimator: Estimator::new(start, Spread { x: 0.1, y: 0.1, yaw: 0.05 }),
            controller: Controller::new(Settings::in_area(area), Path::tunnel_loop())
                .expect("the usual settings are in range"),
            verdict: Verdict::NoPose,
        }
    }

    fn run(&mut self, seconds: u64) {
        for step in 0..seconds * 200 {
            let now = Duration::from_nanos(self.now_ns);
            if step % 13 == 0 {
                self.look(now);
            }
            if step % 4 == 0 {
                self.controller.handle_pose(now, self.estimator.pose());
                let order = self.controller.order(now);
                let command = Command { linear: order.linear, angular: order.angular };
                self.rover.handle_command(self.now_ns, command);
                self.verdict = order.verdict;
            }
            self.rover.advance(self.now_ns, 0.005, self.object.as_ref());
            if let Some(motion) = self.odometer.handle(&self.rover.reading()) {
                self.estimator.predict(&motion);
            }
            self.now_ns += STEP_NS;
        }
    }

    fn look(&mut self, now: Duration) {
        let scene = Scene { object: self.object, seed: self.now_ns, ..Scene::at(self.rover.pose) };
        let round = self.fisheye.render(&scene);
        let round = View::try_from(&round).expect("the camera's pictures are whole");
        let danger = find_red_box(&round).is_some_and(|found| found.score >= 0.8);
        let danger = self.vote.handle(danger);
        self.controller.handle_danger(now, danger);
        let flat = self.camera.render(&scene);
        let flat = View::try_from(&flat).expect("the camera's pictures are whole");
        for seen in find_landmarks(&flat, &self.camera.lens()) {
            self.estimator.correct(&Observation {
                x: seen.landmark.x,
                y: seen.landmark.y,
                bearing: seen.bearing,
                sigma: seen.sigma + 0.006,
                age_s: 0.0,
            });
        }
    }
}

#[test]
fn the_rover_stops_before_the_box_and_goes_on_when_it_is_gone() {
    let mut drive = Drive::new(vec![[0.0, -2.0], [30.0, -2.0], [30.0, 2.0], [0.0, 2.0]]);
    drive.run(8);
    assert_eq!((drive.verdict, drive.rover.stops), (Verdict::Drive, 0));
    let object = DangerousObject::at(drive.rover.pose.x + 3.0, -0.8);

    drive.object = Some(object);
    drive.run(4);
    let gap = drive.rover.pose.distance_to(object.x, object.y);
    assert_eq!(
        (drive.verdict, drive.rover.driving, drive.rover.stops),
        (Verdict::Danger, false, 1)
    );
    assert!(gap > 2.5, "stopped {gap} m before the box");

    drive.object = None;
    drive.run(6);
    assert_eq!((drive.verdict, drive.rover.driving), (Verdict::Drive, true));
    let pose = drive.estimator.pose();
    assert!(drive.rover.pose.distance_to(pose.x, pose.y) < 0.15);
}

#[test]
fn the_rover_stops_where_its_area_ends() {
    let mut drive = Drive::new(vec![[0.0, -2.0], [4.0, -2.0], [4.0, 2.0], [0.0, 2.0]]);

    drive.run(20);

    assert_eq!((drive.verdict, drive.rover.driving), (Verdict::Outside, false));
    assert!((drive.rover.pose.x - 4.0).abs() < 0.2, "{:?}", drive.rover.pose);
}
