//! Golden screens.

use sdr_core::{api::ConditionView, lifecycle::LifecycleState};

use super::*;
use crate::render::fixture;

fn text(view: &StatusView) -> String {
    let lines = screen(view, &problems(view), 80);
    for line in &lines {
        assert!(line.chars().count() <= 80, "{} columns: {line}", line.chars().count());
    }
    lines.join("\n")
}

#[test]
fn a_fleet_that_is_well_is_shown_in_eighty_columns() {
    let golden = "\
3 robots, 1 system      seen from robot-2, coordinator, term 1

ROBOT    SEEN   CPU    FREE MEM  BATTERY  RSSI     ROLE         NOTE
robot-1  0.3 s   38 %   1898 MB  81 %     -55.0 !  -            rssi-low 14 s
robot-2  here    38 %    841 MB  81 %     -47.1    coordinator
robot-3  0.3 s   38 %    312 MB  81 %     -46.8    -

SYSTEM exploration   revision 1   5 of 5 active   5 of 5 connections heard
COMPONENT   HOME     STATE   EPOCH  MEMORY   NOTE
fisheye     robot-3  active  2       530 MB  moved from robot-1: rssi-low
anomaly     robot-3  active  2       530 MB  moved from robot-1: rssi-low
camera      robot-2  active  1       530 MB  robot-1: memory_free 310 MB, bar...
controller  robot-2  active  1       530 MB  robot-1: memory_free 310 MB, bar...
position    robot-3  active  1       530 MB  robot-2: memory_free 310 MB, bar...

why: sdr events -n 20";
    let view = fixture::fleet();
    assert_eq!(text(&view), golden);
    assert_eq!(problems(&view), []);
}

#[test]
fn what_is_wrong_stands_first_with_numbers_and_bars() {
    let mut view = fixture::fleet();
    fixture::make_homeless(&mut view.systems[0].components[4]);
    view.systems[0].components[2].state = Some(LifecycleState::Error);
    view.robots[0].alive = false;
    view.robots[0].seen_ms = 12_000;
    view.robots[0].battery_permille = Some(90);

    let golden = "\
! camera is in error on robot-2 (robot-1: memory_free 310 MB, bar 500 MB)
! position has no home: no robot fits
    robot-1: memory_free 310 MB, bar 500 MB
    robot-2: memory_free 310 MB, bar 500 MB
! robot-1 is quiet for 12 s (last: battery 9 %, 1898 MB free)
";
    let screen = text(&view);
    assert!(screen.starts_with(golden), "{screen}");
}

#[test]
fn a_silent_connection_is_wrong_only_when_both_ends_are_active() {
    let mut view = fixture::fleet();
    view.systems[0].connections[0].heard = false;
    let found = problems(&view);
    assert_eq!(found.len(), 1);
    assert!(found[0].text.starts_with("fisheye.image -> anomaly.image: "), "{found:?}");

    view.systems[0].components[0].state = Some(LifecycleState::Inactive);
    let found = problems(&view);
    assert_eq!(found.len(), 1);
    assert!(found[0].text.starts_with("fisheye is inactive on robot-3"), "{found:?}");
}

#[test]
fn an_empty_fleet_says_what_to_do_next() {
    let mut view = fixture::fleet();
    view.systems.clear();
    assert!(text(&view).ends_with("next: sdr deploy systems/exploration.yaml --wait"));
}

#[test]
fn a_component_on_a_quiet_robot_is_wrong_though_its_last_word_was_active() {
    let mut view = fixture::fleet();
    view.robots[2].alive = false;
    let texts: Vec<String> = problems(&view).into_iter().map(|problem| problem.text).collect();
    assert!(texts.contains(&"fisheye was on robot-3, which is quiet".to_owned()), "{texts:?}");
}

#[test]
fn a_condition_is_wrong_once_it_is_raised_and_shown_before() {
    let mut view = fixture::fleet();
    view.conditions.push(ConditionView {
        system: "exploration".into(),
        component: "camera".into(),
        cause: "memory-short".into(),
        held_ms: 1200,
        hold_ms: 2000,
        raised: false,
        reason: "free 80 MB, bar 100 MB".into(),
    });
    let line = "memory-short of camera on robot-2, held 1.2 s of 2.0 s: free 80 MB, bar 100 MB";
    assert_eq!(problems(&view), []);
    assert!(text(&view).contains(line));

    view.conditions[0].raised = true;
    let raised = "! memory-short of camera on robot-2, raised after 2.0 s: free 80 MB, bar 100 MB";
    assert!(text(&view).starts_with(raised), "{}", text(&view));
}

#[test]
fn among_several_systems_a_component_is_named_with_its_own() {
    let mut view = fixture::fleet();
    let mut other = fixture::exploration();
    other.name = "survey".into();
    other.components[0].state = Some(LifecycleState::Inactive);
    other.connections[4].heard = false;
    view.systems.push(other);

    let found = problems(&view);

    assert!(found[0].text.starts_with("survey/fisheye is inactive on robot-3"), "{found:?}");
    assert_eq!(found[0].component.as_ref().map(|one| one.component.as_str()), Some("fisheye"));
    assert!(found[1].text.starts_with("survey/controller.wheels -> position.wheels: "));
}

#[test]
fn a_quiet_coordinator_is_named_as_the_reason_why_nothing_is_placed() {
    let mut view = fixture::fleet();
    view.robots[1].alive = false;
    view.robots[1].seen_ms = 7_000;
    let line =
        "coordinator robot-2 is quiet for 7.0 s: nothing is placed until another takes the role";
    assert!(problems(&view).iter().all(|problem| problem.text != line), "all are placed");

    fixture::make_homeless(&mut view.systems[0].components[4]);
    assert_eq!(problems(&view)[0].text, line);

    view.coordinator = None;
    let none = "robot-2 knows no coordinator: nothing is placed until one is there";
    assert_eq!(problems(&view)[0].text, none);
}
