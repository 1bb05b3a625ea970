//! The way up a ladder: tries, pauses, refusals, budgets, holds, and the way back.

mod build;

use build::{Scene, at, key, orders, restart_after, restart_only};
use sdr_core::{
    recover::{Cause, Recovery, Remedy, RemedyOutcome},
    spec::PolicyBytes,
    units::{Bytes, Dbm, Permille},
};
use sdr_recovery::{Limits, Policy, make};

fn scene() -> Scene {
    Scene::new(Policy::default(), &["camera"])
}

/// Faults half a second after each order was done.
fn keeps_failing(scene: &mut Scene, times: u64) -> Vec<Remedy> {
    let mut remedies = Vec::new();
    for _ in 0..times {
        let millis = scene.now.as_nanos() / 1_000_000 + 500;
        let verdicts = scene.fails(millis, "camera", Cause::Exited);
        remedies.extend(verdicts.iter().map(|verdict| verdict.remedy));
        scene.outcome("camera", RemedyOutcome::Done);
    }
    remedies
}

#[test]
fn a_component_that_keeps_failing_is_restarted_three_times_then_moved() {
    assert_eq!(
        keeps_failing(&mut scene(), 4),
        [restart_after(0), restart_after(200), restart_after(400), Remedy::LaunchElsewhere]
    );
}

#[test]
fn a_quiet_settling_time_leads_back_to_the_bottom() {
    let mut scene = scene();
    keeps_failing(&mut scene, 2);
    let settled = scene.engine.next_deadline().expect("settling ends some time");
    // The second restart was planned for 200 ms after it was ordered at 1 s.
    assert_eq!(settled, at(11_200));
    assert!(scene.sleep_until(11_200).is_empty());

    let verdicts = scene.fails(11_201, "camera", Cause::Exited);

    assert_eq!(verdicts[0].reason, "because; restart 1 of 3");
    assert_eq!(scene.engine.standing().len(), 1);
}

#[test]
fn ending_a_process_that_hangs_is_no_second_fault() {
    let mut scene = scene();
    scene.fails(0, "camera", Cause::Hung);
    assert!(scene.fails(10, "camera", Cause::Exited).is_empty());

    scene.outcome("camera", RemedyOutcome::Done);

    assert!(scene.sleep_until(60_000).is_empty());
    assert!(scene.engine.standing().is_empty());
}

#[test]
fn an_order_that_is_never_answered_counts_as_failed_once_the_component_failed_again() {
    let mut scene = scene();
    scene.fails(0, "camera", Cause::Exited);
    scene.fails(1_000, "camera", Cause::Exited);

    let verdicts = scene.sleep_until(120_000);

    assert_eq!(verdicts[0].0, 31_000);
    assert_eq!(verdicts[0].1.remedy, restart_after(200));
}

#[test]
fn standby_rungs_are_passed_over_unless_a_standby_is_ready() {
    let mut scene = scene();
    keeps_failing(&mut scene, 3);
    scene.all[0].standby_elsewhere = true;
    let verdicts = scene.fails(2_000, "camera", Cause::Exited);
    assert_eq!(orders(&verdicts), ["camera: standby-elsewhere"]);

    scene.outcome("camera", RemedyOutcome::Refused);
    assert_eq!(orders(&scene.judge()), ["camera: launch-elsewhere"]);
}

#[test]
fn a_bad_robot_asks_for_a_home_for_ever_and_ever_slower() {
    let mut scene = scene();
    scene.judge_at(0);
    scene.robot(|robot| robot.battery = Some(Permille(100)));
    scene.judge();
    let mut asked = Vec::new();
    while asked.len() < 20 {
        let (millis, verdict) = scene.sleep_until(3_600_000).remove(0);
        assert_eq!(verdict.remedy, Remedy::LaunchElsewhere);
        scene.now = at(millis);
        scene.outcome("camera", RemedyOutcome::Refused);
        asked.push(millis);
    }
    let pauses: Vec<u64> = asked.windows(2).map(|pair| (pair[1] - pair[0]) / 1000).collect();
    assert_eq!(pauses[..7], [1, 2, 4, 8, 16, 30, 30]);
}

#[test]
fn an_ill_component_without_a_home_is_held_after_eight_refusals() {
    let mut scene = scene();
    let mut verdicts = scene.fails(0, "camera", Cause::HardwareLost);
    let mut refusals = 0;
    while verdicts[0].remedy != Remedy::Hold {
        scene.outcome("camera", RemedyOutcome::Refused);
        refusals += 1;
        let due = scene.engine.next_deadline().expect("a pause ends");
        verdicts = scene.judge_at(due.as_nanos() / 1_000_000);
    }

    assert_eq!(refusals, 8);
    assert_eq!(verdicts[0].reason, "because; held, no home in 8 tries");
    assert!(scene.sleep_until(7_200_000).is_empty());

    let anew = scene.fails(7_200_001, "camera", Cause::HardwareLost);
    assert_eq!(orders(&anew), ["camera: launch-elsewhere"], "somebody had reset it");
}

#[test]
fn a_hold_for_a_condition_ends_with_the_condition() {
    let parts = Policy::default().parts().clone();
    let mut rules = parts.rules.clone();
    rules.iter_mut().for_each(|rule| rule.ladder = "stop".into());
    let policy = Policy::new(sdr_recovery::PolicyParts { rules, ..parts }).unwrap();
    let mut scene = Scene::new(policy, &["camera"]);
    scene.all[0].cpu = Permille(1000);
    scene.judge_at(0);
    assert_eq!(orders(&[scene.sleep_until(10_000).remove(0).1]), ["camera: hold"]);
    assert!(scene.engine.standing()[0].raised);

    scene.all[0].cpu = Permille(100);
    scene.judge_at(11_000);

    assert!(scene.engine.standing().is_empty());
}

#[test]
fn a_worse_cause_takes_over_and_a_milder_one_waits() {
    let mut scene = scene();
    scene.fails(0, "camera", Cause::Exited);
    scene.outcome("camera", RemedyOutcome::Done);
    let worse = scene.fails(100, "camera", Cause::HardwareLost);
    assert_eq!(orders(&worse), ["camera: launch-elsewhere"]);

    scene.all[0].cpu = Permille(1000);
    scene.judge_at(200);
    assert!(scene.sleep_until(60_000).is_empty());
}

#[test]
fn what_fails_while_it_waits_to_leave_is_started_here_until_it_can() {
    let mut scene = scene();
    scene.robot(|robot| robot.rssi = Some(Dbm::from_tenths(-850)));
    scene.judge_at(0);
    assert_eq!(scene.sleep_until(6_000).len(), 1);
    assert!(scene.fails(7_000, "camera", Cause::Exited).is_empty(), "it may leave any moment");

    let here = scene.sleep_until(12_000).remove(0);
    assert_eq!((here.0, here.1.remedy), (12_000, restart_after(0)));
    scene.now = at(12_000);
    scene.outcome("camera", RemedyOutcome::Done);

    assert!(scene.judge().is_empty(), "it gets its time to settle");
    let away = scene.sleep_until(30_000).remove(0);
    assert_eq!((away.0, away.1.cause), (22_000, Cause::RssiLow));
    assert_eq!(away.1.remedy, Remedy::LaunchElsewhere);
}

#[test]
fn spent_restarts_hold_and_begin_again_when_the_hour_has_room() {
    let limits = Limits { restarts_per_hour: 3, ..Limits::default() };
    let mut scene = Scene::new(restart_only(limits), &["camera"]);
    for second in [0, 100, 200] {
        let verdicts = scene.fails(second * 1000, "camera", Cause::Exited);
        assert_eq!(verdicts[0].remedy, restart_after(0));
        scene.outcome("camera", RemedyOutcome::Done);
        scene.sleep_until(second * 1000 + 50_000);
    }

    let held = scene.fails(300_000, "camera", Cause::Exited);

    assert_eq!(held[0].remedy, Remedy::Hold);
    assert_eq!(held[0].reason, "because; held, the 3 restarts of this hour are spent");
    let again = scene.sleep_until(3_700_000);
    assert_eq!((again[0].0, again[0].1.remedy), (3_600_000, restart_after(0)));
}

#[test]
fn spent_restarts_lead_on_to_the_next_rung_that_has_room() {
    let parts = Policy::default().parts().clone();
    let limits = Limits { restarts_per_hour: 1, moves_per_hour: 1, ..parts.limits };
    let policy = Policy::new(sdr_recovery::PolicyParts { limits, ..parts }).unwrap();
    let mut scene = Scene::new(policy, &["camera"]);

    assert_eq!(keeps_failing(&mut scene, 2), [restart_after(0), Remedy::LaunchElsewhere]);

    scene.engine.forget(&key("camera"));
    assert_eq!(keeps_failing(&mut scene, 2), [restart_after(0), Remedy::Hold]);
    let reason = scene.engine.standing().remove(0).reason;
    assert_eq!(reason, "because");
}

#[test]
fn a_refused_move_costs_nothing_of_the_budget() {
    let parts = Policy::default().parts().clone();
    let limits = Limits { moves_per_hour: 1, ..parts.limits };
    let policy = Policy::new(sdr_recovery::PolicyParts { limits, ..parts }).unwrap();
    let mut scene = Scene::new(policy, &["camera"]);
    scene.robot(|robot| robot.rssi = Some(Dbm::from_tenths(-850)));
    scene.judge_at(0);
    for _ in 0..3 {
        let (millis, verdict) = scene.sleep_until(600_000).remove(0);
        assert_eq!(verdict.remedy, Remedy::LaunchElsewhere);
        scene.now = at(millis);
        scene.outcome("camera", RemedyOutcome::Refused);
    }
}

#[test]
fn a_move_that_was_done_is_not_ordered_again_while_the_old_instance_drains() {
    let mut scene = scene();
    scene.robot(|robot| robot.rssi = Some(Dbm::from_tenths(-850)));
    scene.judge_at(0);
    scene.sleep_until(6_000);
    scene.outcome("camera", RemedyOutcome::Done);

    assert!(scene.fails(6_100, "camera", Cause::Exited).is_empty());
    assert!(scene.sleep_until(15_999).is_empty());
    assert_eq!(scene.sleep_until(16_000).len(), 1, "still here, still weak");
}

#[test]
fn when_the_cause_is_over_a_climb_that_waits_is_over_too() {
    let mut scene = scene();
    scene.robot(|robot| robot.battery = Some(Permille(150)));
    scene.judge_at(0);
    scene.sleep_until(10_000);
    scene.outcome("camera", RemedyOutcome::Refused);

    scene.robot(|robot| robot.battery = Some(Permille(151)));
    scene.judge_at(10_500);

    assert!(scene.sleep_until(60_000).is_empty());
    assert!(scene.engine.standing().is_empty());
}

#[test]
fn a_new_component_does_not_begin_a_hold_that_its_robot_is_in() {
    let mut scene = Scene::new(Policy::default(), &["camera"]);
    scene.robot(|robot| robot.memory_free = Some(Bytes::mega(90)));
    scene.judge_at(0);
    scene.all.push(build::evidence("anomaly"));
    scene.all[1].memory = Bytes::mega(900);
    scene.all[1].robot = scene.all[0].robot;
    scene.judge_at(1_000);

    let verdicts = scene.sleep_until(2_000);

    assert_eq!(verdicts[0].1.component, key("anomaly"));
}

#[test]
fn a_fault_after_short_memory_is_over_begins_at_the_bottom_of_its_own_ladder() {
    let mut scene = scene();
    scene.robot(|robot| robot.memory_free = Some(Bytes::mega(90)));
    scene.judge_at(0);
    scene.sleep_until(2_000);
    scene.outcome("camera", RemedyOutcome::Done);
    scene.robot(|robot| robot.memory_free = Some(Bytes::mega(900)));
    scene.judge();
    scene.sleep_until(7_000);

    let verdicts = scene.fails(8_000, "camera", Cause::Exited);

    assert_eq!((verdicts[0].cause, verdicts[0].remedy), (Cause::Exited, restart_after(0)));
}

#[test]
fn a_break_between_two_looks_is_seen_at_its_deadline() {
    let mut scene = scene();
    let level = |tenths| {
        move |robot: &mut sdr_core::recover::RobotEvidence| {
            robot.rssi = Some(Dbm::from_tenths(tenths));
        }
    };
    scene.robot(level(-850));
    scene.judge_at(0);
    scene.sleep_until(3_000);
    scene.robot(level(-470));
    scene.judge_at(3_000);
    scene.sleep_until(4_000);
    scene.robot(level(-850));
    scene.judge_at(4_000);

    assert_eq!(scene.sleep_until(60_000)[0].0, 10_500, "half a window and the whole hold anew");
}

#[test]
fn an_engine_is_made_from_bytes_and_says_whose_bytes_are_broken() {
    assert_eq!(make(&PolicyBytes::default()).unwrap().not_back_for(&key("camera")).as_secs(), 120);
    let broken = PolicyBytes { name: "mine".into(), bytes: vec![9] };
    assert_eq!(
        make(&broken).err().unwrap(),
        "recovery policy `mine`: policy version 9; this agent reads version 4"
    );
}

#[test]
fn only_a_share_of_the_hold_time_can_pass_before_another_robot_prepares() {
    let mut parts = Policy::default().parts().clone();
    parts.limits.prepare_after = Permille(1200);
    let error = Policy::new(parts).unwrap_err();
    assert_eq!(error.to_string(), "limits: prepare_after is 120 %; at most 100 %");
}
