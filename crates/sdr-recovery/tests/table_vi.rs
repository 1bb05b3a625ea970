//! The paper's Table VI and Fig. 4b: robot-1 fades from -47 to -55 dBm at 107 s.

mod build;

use build::{Noise, Scene, at, exploration, orders};
use sdr_core::{
    recover::{Cause, Recovery, RemedyOutcome},
    units::{Bytes, Dbm},
};

/// Feeds a radio level with noise of 0.5 dB ten times a second; the verdicts and their moment.
fn listen(scene: &mut Scene, noise: &mut Noise, until: u64, level: i16) -> Vec<(u64, Vec<String>)> {
    let mut all = Vec::new();
    let mut millis = scene.now.as_nanos() / 1_000_000;
    while millis < until {
        millis += 100;
        let rssi = Dbm::from_tenths(level + noise.tenths(5.0));
        scene.robot(|robot| robot.rssi = Some(rssi));
        let verdicts = scene.judge_at(millis);
        if !verdicts.is_empty() {
            all.push((millis, orders(&verdicts)));
        }
    }
    all
}

#[test]
fn a_fade_to_minus_55_moves_both_components_six_seconds_after_the_median_fell() {
    for seed in 0..50 {
        let mut noise = Noise(seed);
        let mut scene = Scene::new(exploration(), &["fisheye", "anomaly"]);
        assert!(listen(&mut scene, &mut noise, 107_000, -470).is_empty(), "seed {seed}");

        let verdicts = listen(&mut scene, &mut noise, 120_000, -550);

        assert_eq!(verdicts.len(), 1, "seed {seed}: {verdicts:?}");
        assert!((113_400..=113_800).contains(&verdicts[0].0), "seed {seed}: {verdicts:?}");
        assert_eq!(verdicts[0].1, ["fisheye: launch-elsewhere", "anomaly: launch-elsewhere"]);
    }
}

#[test]
fn the_verdict_says_when_the_hold_was_over_and_with_which_numbers() {
    let mut scene = Scene::new(exploration(), &["fisheye"]);
    scene.judge_at(100_000);
    scene.robot(|robot| robot.rssi = Some(Dbm::from_tenths(-548)));
    scene.judge_at(107_000);
    assert_eq!(scene.engine.next_deadline(), Some(at(107_500)));
    scene.judge_at(107_500);
    assert_eq!(
        scene.engine.standing()[0].reason,
        "rssi -54.8 dBm, bar -52.5 dBm, held 0.0 of 6.0 s"
    );
    assert_eq!(scene.engine.next_deadline(), Some(at(113_500)));

    let verdicts = scene.judge_at(114_000);

    assert_eq!(verdicts[0].cause, Cause::RssiLow);
    assert_eq!(verdicts[0].held_over_at, at(113_500));
    assert_eq!(verdicts[0].reason, "rssi -54.8 dBm, bar -52.5 dBm, held 6.5 s");
}

#[test]
fn a_dip_shorter_than_six_seconds_moves_nothing() {
    for seed in 0..20 {
        let mut noise = Noise(seed);
        let mut scene = Scene::new(exploration(), &["fisheye"]);
        listen(&mut scene, &mut noise, 10_000, -470);
        assert!(listen(&mut scene, &mut noise, 15_500, -550).is_empty(), "seed {seed}");
        assert!(listen(&mut scene, &mut noise, 60_000, -470).is_empty(), "seed {seed}");
    }
}

#[test]
fn noise_around_the_bar_raises_at_most_once_and_never_flaps() {
    for seed in 0..50 {
        let mut noise = Noise(seed);
        let mut scene = Scene::new(exploration(), &["fisheye", "anomaly"]);

        let verdicts = listen(&mut scene, &mut noise, 600_000, -525);

        // Nobody answers the order, so a second one could only come from flapping.
        assert!(verdicts.len() <= 1, "seed {seed}: {verdicts:?}");
        if let Some((_, orders)) = verdicts.first() {
            assert_eq!(orders.len(), 2, "seed {seed}: both or none");
        }
    }
}

#[test]
fn half_a_decibel_above_the_bar_is_quiet_for_ever() {
    for seed in 0..20 {
        let mut noise = Noise(seed);
        let mut scene = Scene::new(exploration(), &["fisheye"]);
        assert!(listen(&mut scene, &mut noise, 600_000, -518).is_empty(), "seed {seed}");
    }
}

#[test]
fn it_is_over_only_after_ten_seconds_at_minus_50() {
    let mut noise = Noise(7);
    let mut scene = Scene::new(exploration(), &["fisheye"]);
    listen(&mut scene, &mut noise, 10_000, -550);
    scene.outcome("fisheye", RemedyOutcome::Refused);

    let again = listen(&mut scene, &mut noise, 60_000, -510);
    assert!(!again.is_empty(), "-51 dBm does not end it, so it is asked for again");
    scene.outcome("fisheye", RemedyOutcome::Refused);
    listen(&mut scene, &mut noise, 70_200, -490);
    assert!(scene.engine.standing()[0].raised);
    listen(&mut scene, &mut noise, 71_000, -490);
    assert!(scene.engine.standing().is_empty());
    assert!(listen(&mut scene, &mut noise, 200_000, -490).is_empty());
}

#[test]
fn three_components_on_robot_3_leave_310_mb_and_that_is_no_fault() {
    let mut scene = Scene::new(exploration(), &["position", "fisheye", "anomaly"]);
    scene.robot(|robot| robot.memory_free = Some(Bytes::mega(310)));
    scene.judge_at(0);
    assert!(scene.judge_at(600_000).is_empty());

    scene.robot(|robot| robot.memory_free = Some(Bytes::mega(200)));
    scene.judge();
    assert_eq!(scene.sleep_until(602_000).len(), 1);
}
