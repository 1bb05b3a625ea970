//! The filter against the truth of the lab's rover and pictures, in virtual time.

use sdr_lab::device::Command;
use sdr_lab::noise::Noise;
use sdr_lab::tunnel::{LANDMARKS, Pose};
use sdr_lab::world::{Camera, Rover, Scene, TRACK_M};

use super::*;
use crate::control::{Guide, GuideSettings, Path};
use crate::vision::{View, find_landmarks};

const SPREAD: Spread = Spread { x: 0.1, y: 0.1, yaw: 0.05 };
const STEP_NS: u64 = 5_000_000;

struct Errors {
    fused_mean: f64,
    fused_worst: f64,
    reckoned_end: f64,
    fused_end: f64,
    refused_share: f64,
}

/// One lap's part: stands a second, then drives the loop through the tunnel by the truth.
fn run(seed: u64, seconds: u64) -> Errors {
    let start = Pose::new(1.5, -0.8, 0.0);
    let mut rover = Rover::new(start, Noise::stream(seed, 0));
    let camera = Camera::perspective();
    let mut guide = Guide::new(Path::tunnel_loop(), GuideSettings::default());
    let mut odometer = Odometer::new(TRACK_M);
    let mut reckoning = DeadReckoning::new(start);
    let mut estimator = Estimator::new(start, SPREAD);
    let (mut sum, mut worst, mut count) = (0.0, 0.0_f64, 0.0);
    for step in 0..seconds * 200 {
        let now_ns = step * STEP_NS;
        if step % 4 == 0 && step > 200 {
            let (linear, angular) = guide.steer(&rover.pose);
            rover.handle_command(now_ns, Command { linear, angular });
        }
        rover.advance(now_ns, 0.005, None);
        if step % 2 == 0
            && let Some(motion) = odometer.handle(&rover.reading())
        {
            reckoning.advance(&motion);
            estimator.predict(&motion);
        }
        if step % 20 == 0 {
            let picture = camera.render(&Scene { seed: step, ..Scene::at(rover.pose) });
            for seen in find_landmarks(&View::try_from(&picture).unwrap(), &camera.lens()) {
                estimator.correct(&Observation {
                    x: seen.landmark.x,
                    y: seen.landmark.y,
                    bearing: seen.bearing,
                    sigma: seen.sigma + 0.006,
                    age_s: 0.0,
                });
            }
            let error = rover.pose.distance_to(estimator.pose().x, estimator.pose().y);
            (sum, worst, count) = (sum + error, worst.max(error), count + 1.0);
        }
    }
    let off = |pose: Pose| rover.pose.distance_to(pose.x, pose.y);
    let (accepted, refused) = estimator.counts();
    Errors {
        fused_mean: sum / count,
        fused_worst: worst,
        reckoned_end: off(reckoning.pose),
        fused_end: off(estimator.pose()),
        refused_share: refused as f64 / (accepted + refused).max(1) as f64,
    }
}

#[test]
fn the_fused_estimate_beats_dead_reckoning_on_a_lap() {
    let runs: Vec<Errors> = (1..=2).map(|seed| run(seed, 120)).collect();

    for errors in &runs {
        assert!(errors.fused_mean < 0.15, "mean {}", errors.fused_mean);
        assert!(errors.fused_worst < 0.6, "worst {}", errors.fused_worst);
        assert!(errors.refused_share < 0.1, "refused {}", errors.refused_share);
    }
    let fused: f64 = runs.iter().map(|errors| errors.fused_end).sum();
    let reckoned: f64 = runs.iter().map(|errors| errors.reckoned_end).sum();
    assert!(fused * 2.0 < reckoned, "fused {fused}, dead reckoning {reckoned}");
}

fn bearings(estimator: &mut Estimator, truth: &Pose, rounds: usize) {
    for _ in 0..rounds {
        for post in LANDMARKS.iter().filter(|post| truth.bearing_to(post.x, post.y).abs() < 0.6) {
            let bearing = truth.bearing_to(post.x, post.y);
            let (x, y) = (post.x, post.y);
            estimator.correct(&Observation { x, y, bearing, sigma: 0.01, age_s: 0.0 });
        }
    }
}

#[test]
fn a_wrong_bearing_is_refused_and_changes_nothing() {
    let pose = Pose::new(5.0, 0.0, 0.0);
    let mut estimator = Estimator::new(pose, SPREAD);
    let seen = Observation { x: 9.0, y: 1.8, bearing: -0.4, sigma: 0.01, age_s: 0.0 };

    let verdict = estimator.correct(&seen);

    assert!(matches!(verdict, Correction::Refused { distance } if distance > 9.0), "{verdict:?}");
    assert_eq!(estimator.pose(), pose);
    let senseless = Observation { bearing: f64::NAN, ..seen };
    assert_eq!(estimator.correct(&senseless), Correction::Senseless);
    assert_eq!(estimator.correct(&Observation { age_s: -0.1, ..seen }), Correction::Senseless);
}

#[test]
fn bearings_shrink_the_spread_and_pull_towards_the_truth() {
    let truth = Pose::new(5.3, 0.2, 0.04);
    let mut estimator = Estimator::new(Pose::new(5.1, 0.1, 0.0), Spread { x: 0.3, ..SPREAD });

    bearings(&mut estimator, &truth, 10);

    assert!(truth.distance_to(estimator.pose().x, estimator.pose().y) < 0.05);
    assert!(estimator.spread().x < 0.1 && estimator.spread().yaw < 0.02);
}

#[test]
fn a_lost_estimate_finds_itself_again() {
    let truth = Pose::new(8.0, -0.5, 0.1);
    let mut estimator = Estimator::new(Pose::new(6.0, 0.3, -0.2), SPREAD);

    bearings(&mut estimator, &truth, 120);

    let pose = estimator.pose();
    assert!(truth.distance_to(pose.x, pose.y) < 0.1, "{pose:?}");
}

#[test]
fn the_age_of_a_bearing_is_made_up_for() {
    let truth = Pose::new(5.0, 0.0, 0.0);
    let spin = Motion { linear: 0.0, angular: 1.0, seconds: 0.1 };
    let mut estimator = Estimator::new(truth, Spread { x: 0.01, y: 0.01, yaw: 0.2 });
    let bearing = truth.bearing_to(9.0, 1.8);
    estimator.predict(&spin);

    estimator.correct(&Observation { x: 9.0, y: 1.8, bearing, sigma: 0.01, age_s: 0.1 });

    assert!((estimator.pose().yaw - 0.1).abs() < 0.001, "{:?}", estimator.pose());
}

#[test]
fn the_estimate_survives_saving_and_loading() {
    let mut estimator = Estimator::new(Pose::new(5.0, 0.1, 0.3), SPREAD);
    bearings(&mut estimator, &Pose::new(5.0, 0.1, 0.3), 2);

    let saved = serde_json::to_vec(&estimator).unwrap();

    assert_eq!(serde_json::from_slice::<Estimator>(&saved).unwrap(), estimator);
}
