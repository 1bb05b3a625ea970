use sdr_lab::noise::Noise;
use sdr_lab::optics::Picture;
use sdr_lab::tunnel::{DangerousObject, Pose};
use sdr_lab::world::{CAMERA_HEIGHT_M, Camera, Scene};

use super::*;

/// The bar of the demo's system file.
const SCORE_MIN: f64 = 0.8;

fn score_of(picture: &Picture) -> f64 {
    find_red_box(&View::try_from(picture).unwrap()).map_or(0.0, |found| found.score)
}

fn canvas(paint: impl Fn(usize, usize) -> [u8; 3]) -> Picture {
    let (width, height) = (160, 120);
    let rgb = (0..width * height).flat_map(|i| paint(i % width, i / width)).collect();
    Picture { width, height, rgb }
}

#[test]
fn the_box_is_found_in_the_fisheye_from_many_poses_with_its_bearing() {
    let camera = Camera::fisheye();
    let mut noise = Noise::new(11);
    for seed in 0..60 {
        let pose = Pose::new(
            2.0 + 20.0 * noise.uniform(),
            2.0 * noise.uniform() - 1.0,
            noise.uniform() - 0.5,
        );
        let (distance, aside) = (1.2 + 4.8 * noise.uniform(), 2.4 * noise.uniform() - 1.2);
        let object = DangerousObject::at(pose.x + distance, aside);
        let scene = Scene { object: Some(object), seed, ..Scene::at(pose) };

        let picture = camera.render(&scene);

        let found = find_red_box(&View::try_from(&picture).unwrap()).unwrap();
        let error = found.bearing(&camera.lens()).unwrap() - pose.bearing_to(object.x, object.y);
        assert!(found.score >= SCORE_MIN, "{} at {pose:?} {object:?}", found.score);
        assert!(error.abs() < 0.12, "bearing off by {error} at {pose:?} {object:?}");
    }
}

#[test]
fn the_tunnel_without_the_box_is_quiet_in_both_cameras() {
    let mut noise = Noise::new(12);
    for seed in 0..60 {
        let pose = Pose::new(
            0.5 + 29.0 * noise.uniform(),
            3.0 * noise.uniform() - 1.5,
            std::f64::consts::TAU * noise.uniform(),
        );
        let light = if seed % 2 == 0 { 1.4 } else { 0.5 };
        let scene = Scene { seed, light, ..Scene::at(pose) };
        for camera in [Camera::fisheye(), Camera::perspective()] {
            let score = score_of(&camera.render(&scene));
            assert!(score < 0.2, "{score} at {pose:?}");
        }
    }
}

#[test]
fn the_box_is_found_in_dim_light_and_nothing_in_the_dark() {
    let object = Some(DangerousObject::at(8.0, 0.2));
    let scene = Scene { object, ..Scene::at(Pose::new(5.0, 0.0, 0.0)) };
    let camera = Camera::fisheye();

    assert!(score_of(&camera.render(&Scene { light: 0.4, ..scene })) >= SCORE_MIN);
    assert!(score_of(&camera.render(&Scene { light: 0.0, ..scene })) < 0.01);
}

#[test]
fn a_box_farther_away_scores_no_higher() {
    let camera = Camera::fisheye();
    let score = |distance: f64| {
        let object = Some(DangerousObject::at(3.0 + distance, 0.0));
        score_of(&camera.render(&Scene { object, ..Scene::at(Pose::new(3.0, 0.0, 0.0)) }))
    };

    assert!(score(2.0) > 0.99);
    assert!(score(5.0) >= score(9.0) && score(9.0) >= score(20.0));
    assert!(score(20.0) < SCORE_MIN);
}

#[test]
fn the_distance_of_a_standing_box_is_roughly_known() {
    let camera = Camera::fisheye();
    let object = Some(DangerousObject::at(6.3, 0.0));
    let picture = camera.render(&Scene { object, ..Scene::at(Pose::new(3.0, 0.0, 0.0)) });

    let found = find_red_box(&View::try_from(&picture).unwrap()).unwrap();

    let distance = found.distance_m(&camera.lens(), CAMERA_HEIGHT_M).unwrap();
    assert!((distance - 3.0).abs() < 0.4, "{distance}");
}

#[test]
fn other_saturated_colours_and_red_that_is_no_box_are_quiet() {
    let grey = [90, 88, 85];
    let square = |colour: [u8; 3]| {
        move |x: usize, y: usize| {
            if x.abs_diff(80) < 15 && y.abs_diff(60) < 15 { colour } else { grey }
        }
    };
    for colour in [[250, 140, 0], [230, 0, 230], [240, 240, 10], [150, 75, 30], [250, 150, 150]] {
        assert!(score_of(&canvas(square(colour))) < 0.2, "{colour:?}");
    }
    assert!(score_of(&canvas(square([210, 20, 15]))) >= SCORE_MIN);
    let red = [210, 20, 15];
    let line = canvas(|_, y| if y.abs_diff(60) < 3 { red } else { grey });
    let ring = canvas(|x, y| {
        let square = x.abs_diff(80).pow(2) + y.abs_diff(60).pow(2);
        if (35 * 35..40 * 40).contains(&square) { red } else { grey }
    });
    let flood = canvas(|_, _| red);
    for (name, picture) in [("line", line), ("ring", ring), ("flood", flood)] {
        assert!(score_of(&picture) < 0.5, "{name}: {}", score_of(&picture));
    }
}

#[test]
fn noise_alone_is_quiet() {
    let mut noise = Noise::new(5);
    let mut rgb = Vec::new();
    while rgb.len() < 240 * 240 * 3 {
        rgb.extend(noise.bits().to_le_bytes());
    }
    rgb.truncate(240 * 240 * 3);

    assert!(score_of(&Picture { width: 240, height: 240, rgb }) < 0.3);
}

#[test]
fn a_vote_needs_two_of_three() {
    let mut vote = Vote::default();

    let said: Vec<bool> =
        [true, false, true, true, false, false].map(|danger| vote.handle(danger)).to_vec();

    assert_eq!(said, [false, false, true, true, true, false]);
}
