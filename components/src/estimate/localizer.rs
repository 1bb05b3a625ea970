//! All of position estimation in one hand: motion, pictures, and getting lost.

use sdr_lab::tunnel::Pose;
use serde::{Deserialize, Serialize};

use super::filter::{Correction, Estimator, Observation, Spread};
use super::locate::locate;
use super::odometer::Motion;
use crate::vision::Sighting;

/// Added to the spread of a bearing for what the map and the mount do not know, radians.
const MOUNT_SIGMA_RAD: f64 = 0.006;
/// Pictures in a row whose bearings mostly contradict the estimate, until it is given up.
const CONTRADICTIONS_MAX: u32 = 5;
/// What a pose from one picture is worth.
const LOCATED: Spread = Spread { x: 0.4, y: 0.3, yaw: 0.1 };

/// Position estimation; it may be saved and loaded whole.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize)]
pub struct Localizer {
    estimator: Option<Estimator>,
    contradictions: u32,
    relocations: u32,
}

impl Localizer {
    /// Begins where the rover is believed to be.
    pub fn at(pose: Pose, spread: Spread) -> Self {
        Self { estimator: Some(Estimator::new(pose, spread)), contradictions: 0, relocations: 0 }
    }

    /// Begins with no idea: the first picture with enough posts tells.
    pub fn lost() -> Self {
        Self::default()
    }

    /// Takes a motion.
    pub fn handle_motion(&mut self, motion: &Motion) {
        if let Some(estimator) = &mut self.estimator {
            estimator.predict(motion);
        }
    }

    /// Takes what one picture shows; `age_s` is its age by the newest motion, 0 to 1 s.
    pub fn handle_sightings(&mut self, sightings: &[Sighting], age_s: f64) {
        let Some(estimator) = &mut self.estimator else {
            self.relocate(sightings);
            return;
        };
        let mut refused = 0;
        for seen in sightings {
            let observation = Observation {
                x: seen.landmark.x,
                y: seen.landmark.y,
                bearing: seen.bearing,
                sigma: seen.sigma + MOUNT_SIGMA_RAD,
                age_s,
            };
            if let Correction::Refused { .. } = estimator.correct(&observation) {
                refused += 1;
            }
        }
        if refused * 2 > sightings.len() {
            self.contradictions += 1;
            if self.contradictions >= CONTRADICTIONS_MAX {
                self.relocate(sightings);
            }
        } else if !sightings.is_empty() {
            self.contradictions = 0;
        }
    }

    /// The estimate and its spread; `None` while lost.
    pub fn estimate(&self) -> Option<(Pose, Spread)> {
        self.estimator.as_ref().map(|estimator| (estimator.pose(), estimator.spread()))
    }

    /// The filter behind the estimate.
    pub fn estimator(&self) -> Option<&Estimator> {
        self.estimator.as_ref()
    }

    /// How often a single picture had to tell the place.
    pub fn relocations(&self) -> u32 {
        self.relocations
    }

    fn relocate(&mut self, sightings: &[Sighting]) {
        if let Some(pose) = locate(sightings) {
            self.estimator = Some(Estimator::new(pose, LOCATED));
            self.contradictions = 0;
            self.relocations += 1;
        }
    }
}

#[cfg(test)]
mod tests {
    use sdr_lab::device::Command;
    use sdr_lab::noise::Noise;
    use sdr_lab::world::{Camera, Rover, Scene, TRACK_M};

    use super::*;
    use crate::estimate::Odometer;
    use crate::vision::{View, find_landmarks};

    /// Drives straight for some seconds with the localizer on board; where it really is.
    fn drive(localizer: &mut Localizer, seconds: u64) -> Pose {
        let mut rover = Rover::new(Pose::new(12.0, -0.8, 0.0), Noise::new(3));
        let camera = Camera::perspective();
        let mut odometer = Odometer::new(TRACK_M);
        for step in 0..seconds * 200 {
            let now_ns = step * 5_000_000;
            rover.handle_command(now_ns, Command { linear: 0.3, angular: 0.0 });
            rover.advance(now_ns, 0.005, None);
            if let Some(motion) = odometer.handle(&rover.reading()) {
                localizer.handle_motion(&motion);
            }
            if step % 13 == 0 {
                let picture = camera.render(&Scene { seed: step, ..Scene::at(rover.pose) });
                let view = View::try_from(&picture).unwrap();
                localizer.handle_sightings(&find_landmarks(&view, &camera.lens()), 0.0);
            }
        }
        rover.pose
    }

    #[test]
    fn a_lost_localizer_finds_the_rover_by_pictures() {
        let mut localizer = Localizer::lost();
        assert_eq!(localizer.estimate(), None);

        let truth = drive(&mut localizer, 10);

        let (pose, spread) = localizer.estimate().unwrap();
        assert!(truth.distance_to(pose.x, pose.y) < 0.1, "{pose:?} is {truth:?}");
        assert!(spread.x < 0.1 && localizer.relocations() == 1);
    }

    #[test]
    fn a_localizer_that_believes_the_wrong_end_of_the_tunnel_changes_its_mind() {
        let narrow = Spread { x: 0.1, y: 0.1, yaw: 0.05 };
        let mut localizer = Localizer::at(Pose::new(1.5, -0.8, 0.0), narrow);

        let truth = drive(&mut localizer, 15);

        let (pose, _) = localizer.estimate().unwrap();
        assert!(truth.distance_to(pose.x, pose.y) < 0.1, "{pose:?} is {truth:?}");
        assert!(localizer.relocations() >= 1);
    }

    #[test]
    fn a_localizer_that_is_right_needs_no_relocation() {
        let narrow = Spread { x: 0.1, y: 0.1, yaw: 0.05 };
        let mut localizer = Localizer::at(Pose::new(12.05, -0.75, 0.01), narrow);

        let truth = drive(&mut localizer, 10);

        let (pose, _) = localizer.estimate().unwrap();
        assert!(truth.distance_to(pose.x, pose.y) < 0.1, "{pose:?} is {truth:?}");
        assert_eq!(localizer.relocations(), 0);
        let saved = serde_json::to_vec(&localizer).unwrap();
        assert_eq!(serde_json::from_slice::<Localizer>(&saved).unwrap(), localizer);
    }
}
