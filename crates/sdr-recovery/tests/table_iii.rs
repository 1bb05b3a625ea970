//! Each row of the paper's Table III under the default policy.

mod build;

use std::time::Duration;

use build::{Scene, at, key, orders, restart_after};
use sdr_core::{
    recover::{Cause, Recovery, Remedy, RemedyOutcome, RobotEvidence, Spread},
    units::{Bytes, Dbm, Permille},
};
use sdr_recovery::Policy;

fn scene() -> Scene {
    Scene::new(Policy::default(), &["fisheye", "anomaly"])
}

/// Sets a bad figure at 1 s and sleeps; the moment and the orders of the first verdicts.
fn first(change: impl Fn(&mut RobotEvidence)) -> (u64, Cause, Vec<String>) {
    let mut scene = scene();
    scene.judge_at(0);
    scene.now = at(1_000);
    scene.robot(change);
    assert!(scene.judge().is_empty(), "a hold has no haste");
    let verdicts = scene.sleep_until(60_000);
    let (millis, cause) = (verdicts[0].0, verdicts[0].1.cause);
    let all: Vec<_> = verdicts.into_iter().map(|(_, verdict)| verdict).collect();
    (millis, cause, orders(&all))
}

const BOTH_LEAVE: [&str; 2] = ["fisheye: launch-elsewhere", "anomaly: launch-elsewhere"];

#[test]
fn short_memory_restarts_the_largest_component_first_and_one_at_a_time() {
    let mut scene = scene();
    scene.all[1].memory = Bytes::mega(600);
    scene.judge_at(0);
    scene.robot(|robot| robot.memory_free = Some(Bytes::mega(100)));
    scene.judge_at(1_000);

    let verdicts = scene.sleep_until(20_000);

    assert_eq!(verdicts.len(), 1);
    assert_eq!(verdicts[0].0, 3_000);
    assert_eq!(verdicts[0].1.component, key("anomaly"));
    assert_eq!(verdicts[0].1.remedy, restart_after(0));
    assert_eq!(verdicts[0].1.reason, "memory_free 100 MB, bar 100 MB, held 2.0 s; restart 1 of 3");
}

#[test]
fn short_memory_that_restarting_does_not_mend_moves_the_component_then_takes_the_next() {
    let mut scene = scene();
    scene.robot(|robot| robot.memory_free = Some(Bytes::mega(50)));
    scene.judge_at(0);
    let mut seen = Vec::new();
    for _ in 0..4 {
        let verdicts = scene.sleep_until(scene.now.as_nanos() / 1_000_000 + 60_000);
        assert_eq!(verdicts.len(), 1, "{verdicts:?}");
        seen.push(verdicts[0].1.remedy);
        scene.now = at(verdicts[0].0);
        scene.outcome("anomaly", RemedyOutcome::Done);
    }
    assert_eq!(
        seen,
        [restart_after(0), restart_after(200), restart_after(400), Remedy::LaunchElsewhere]
    );

    scene.leaves("anomaly");
    let next = scene.judge();
    assert_eq!(orders(&next), ["fisheye: restart"]);
}

#[test]
fn short_memory_is_over_only_when_there_is_clearly_more() {
    let mut scene = scene();
    scene.robot(|robot| robot.memory_free = Some(Bytes::mega(90)));
    scene.judge_at(0);
    scene.sleep_until(2_000);
    assert!(scene.engine.standing().iter().all(|status| status.raised));

    scene.robot(|robot| robot.memory_free = Some(Bytes::mega(199)));
    scene.judge_at(3_000);
    scene.sleep_until(30_000);
    assert!(scene.engine.standing().iter().all(|status| status.raised));

    scene.robot(|robot| robot.memory_free = Some(Bytes::mega(200)));
    scene.judge_at(31_000);
    scene.sleep_until(36_000);
    assert!(scene.engine.standing().is_empty());
}

#[test]
fn a_component_that_takes_too_much_cpu_is_restarted_and_its_neighbour_left_alone() {
    let mut scene = scene();
    scene.judge_at(0);
    scene.all[0].cpu = Permille(950);
    scene.judge_at(1_000);

    let verdicts = scene.sleep_until(11_000);

    assert_eq!(verdicts[0].0, 11_000);
    assert_eq!(verdicts[0].1.cause, Cause::ComponentCpuHigh);
    assert_eq!(verdicts[0].1.remedy, restart_after(0));
    assert_eq!(verdicts.len(), 1);
}

#[test]
fn a_component_that_declared_more_than_a_core_may_take_it() {
    let mut scene = scene();
    scene.judge_at(0);
    scene.all[0].cpu_limit = Permille(2000);
    scene.all[0].cpu = Permille(1899);
    scene.judge_at(1_000);
    assert!(scene.sleep_until(60_000).is_empty());

    scene.all[0].cpu = Permille(1900);
    scene.judge();
    assert_eq!(scene.sleep_until(70_000).len(), 1);
}

#[test]
fn exits_hangs_and_errors_without_a_reason_are_restarted_here() {
    for cause in [Cause::Exited, Cause::Hung, Cause::Error] {
        let mut scene = scene();
        let verdicts = scene.fails(5, "anomaly", cause);
        assert_eq!(verdicts.len(), 1);
        assert_eq!((verdicts[0].cause, verdicts[0].remedy), (cause, restart_after(0)));
        assert_eq!(verdicts[0].held_over_at, at(5));
        assert!(scene.judge_at(6).is_empty(), "an order is given once");
    }
}

#[test]
fn a_standby_here_is_switched_in_before_anything_is_restarted() {
    let mut scene = scene();
    scene.all[1].standby_here = true;

    let first = scene.fails(0, "anomaly", Cause::Exited);
    scene.outcome("anomaly", RemedyOutcome::Done);
    let again = scene.fails(3_000, "anomaly", Cause::Exited);

    assert_eq!(orders(&first), ["anomaly: local-standby"]);
    assert_eq!(orders(&again), ["anomaly: restart"]);
}

#[test]
fn lost_hardware_and_odd_behaviour_leave_this_robot_at_once() {
    for cause in [Cause::HardwareLost, Cause::AbnormalBehaviour, Cause::EmergencyStop] {
        let mut scene = scene();
        assert_eq!(orders(&scene.fails(0, "anomaly", cause)), ["anomaly: launch-elsewhere"]);

        let mut scene = self::scene();
        scene.all[1].standby_elsewhere = true;
        assert_eq!(orders(&scene.fails(0, "anomaly", cause)), ["anomaly: standby-elsewhere"]);
    }
}

#[test]
fn an_emergency_stop_of_what_drives_a_body_holds_until_it_is_reset() {
    let mut scene = scene();
    scene.all[1].actuator = true;

    let verdicts = scene.fails(0, "anomaly", Cause::EmergencyStop);

    assert_eq!(verdicts[0].remedy, Remedy::Hold);
    assert_eq!(verdicts[0].reason, "because; held until reset, as the policy says");
    for (millis, cause) in [(10, Cause::Exited), (60_000, Cause::Exited), (90_000, Cause::Error)] {
        assert!(scene.fails(millis, "anomaly", cause).is_empty(), "{cause} does not start it");
    }
    scene.robot(|robot| robot.rssi = Some(Dbm::from_tenths(-900)));
    scene.judge_at(100_000);
    let moved = scene.sleep_until(130_000);
    assert!(moved.iter().all(|(_, verdict)| verdict.component == key("fisheye")));
    assert!(scene.engine.standing().iter().any(|status| status.cause == Cause::EmergencyStop));

    scene.robot(|robot| robot.rssi = Some(Dbm::from_tenths(-470)));
    scene.judge_at(131_000);
    scene.sleep_until(142_000);
    scene.engine.forget(&key("anomaly"));
    assert_eq!(orders(&scene.fails(150_000, "anomaly", Cause::Exited)), ["anomaly: restart"]);
}

#[test]
fn an_emergency_stop_overtakes_a_climb_that_is_under_way() {
    let mut scene = scene();
    scene.all[1].actuator = true;
    scene.fails(0, "anomaly", Cause::Exited);

    let verdicts = scene.fails(100, "anomaly", Cause::EmergencyStop);

    assert_eq!(orders(&verdicts), ["anomaly: hold"]);
    scene.outcome("anomaly", RemedyOutcome::Done);
    assert!(scene.sleep_until(100_000).is_empty());
}

#[test]
fn a_low_battery_moves_all_components_after_ten_seconds() {
    let (millis, cause, orders) = first(|robot| robot.battery = Some(Permille(150)));
    assert_eq!((millis, cause), (11_000, Cause::BatteryLow));
    assert_eq!(orders, BOTH_LEAVE);
}

#[test]
fn a_busy_robot_moves_all_components_after_thirty_seconds() {
    let (millis, cause, orders) = first(|robot| robot.cpu = Some(Permille(950)));
    assert_eq!((millis, cause), (31_000, Cause::RobotCpuHigh));
    assert_eq!(orders, BOTH_LEAVE);
}

#[test]
fn a_low_radio_level_moves_all_components_half_a_second_and_six_after_it_fell() {
    let (millis, cause, orders) = first(|robot| robot.rssi = Some(Dbm::from_tenths(-800)));
    assert_eq!((millis, cause), (7_500, Cause::RssiLow));
    assert_eq!(orders, BOTH_LEAVE);
}

#[test]
fn delay_jitter_and_loss_move_all_components_after_six_seconds() {
    let millis = Duration::from_millis;
    let rows = [
        first(|robot| robot.delay = Some(Spread::of_one(millis(200)))),
        first(|robot| robot.jitter = Some(Spread::of_one(millis(100)))),
        first(|robot| robot.loss = Some(Spread::of_one(Permille(200)))),
    ];
    let causes = [Cause::DelayHigh, Cause::JitterHigh, Cause::LossHigh];
    for ((at, found, orders), cause) in rows.into_iter().zip(causes) {
        assert_eq!((at, found), (7_000, cause));
        assert_eq!(orders, BOTH_LEAVE);
    }
}

#[test]
fn components_of_a_robot_that_is_gone_are_launched_elsewhere_at_once() {
    let mut scene = scene();
    scene.robot(|robot| *robot = RobotEvidence::default());
    scene.all.iter_mut().for_each(|one| one.fault = build::fault(Cause::RobotGone));

    assert_eq!(orders(&scene.judge_at(0)), BOTH_LEAVE);
}

#[test]
fn just_beside_every_bar_nothing_happens() {
    let mut scene = scene();
    scene.robot(|robot| {
        *robot = RobotEvidence {
            memory_free: Some(Bytes(100_000_001)),
            cpu: Some(Permille(949)),
            battery: Some(Permille(151)),
            rssi: Some(Dbm::from_tenths(-799)),
            delay: Some(Spread::of_one(Duration::from_micros(199_999))),
            jitter: Some(Spread::of_one(Duration::from_micros(99_999))),
            loss: Some(Spread::of_one(Permille(199))),
        };
    });
    scene.all[0].cpu = Permille(949);
    scene.judge_at(0);

    assert_eq!(scene.engine.next_deadline(), None);
    assert!(scene.judge_at(600_000).is_empty());
    assert!(scene.engine.standing().is_empty());
}

#[test]
fn what_nobody_knows_raises_nothing() {
    let mut scene = scene();
    scene.robot(|robot| *robot = RobotEvidence::default());
    scene.judge_at(0);

    assert!(scene.judge_at(600_000).is_empty());
    assert_eq!(scene.engine.next_deadline(), None);
}
