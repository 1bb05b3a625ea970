//! Screens of the coordinator role.

use sdr_core::{event::Event, fitness::RolePolicy, id::RobotId};

use super::*;
use crate::render::fixture::fleet;

fn candidate(robot: &str, links: u32, unfit: Option<&str>) -> CandidateView {
    let part =
        |aspect: &str, score, weight| FitnessPartView { aspect: aspect.into(), score, weight };
    CandidateView {
        robot: robot.into(),
        points: (800 + 3 * links) / 4,
        unfit: unfit.map(Into::into),
        preferred: false,
        parts: vec![part("battery", 800, 1), part("cpu", 900, 0), part("links", links, 3)],
    }
}

fn view() -> StatusView {
    let robot = |name| RobotId::new(name).unwrap();
    let rules = RolePolicy {
        pinned: vec![robot("robot-3")],
        forbidden: vec![robot("robot-4")],
        ..RolePolicy::default()
    };
    let role = RoleView {
        holder: Some("robot-2".into()),
        term: 3,
        successors: vec!["robot-3".into(), "robot-1".into()],
        offered_to: Some("robot-3".into()),
        reason: "it is preferred".into(),
        policy: "default".into(),
        rules,
        candidates: vec![
            CandidateView { preferred: true, ..candidate("robot-3", 600, None) },
            candidate("robot-2", 900, None),
            candidate("robot-1", 200, Some("rssi -85.0 dBm, bar -80.0 dBm")),
        ],
        ..RoleView::default()
    };
    StatusView { role, ..fleet() }
}

#[test]
fn the_screen_says_who_holds_it_who_follows_and_who_could() {
    let taken =
        Taken { wall_ms: 3_723_004, reason: "term 3, robot-1 is silent for 1300 ms".into() };
    let lines = screen(&view(), Some(&taken), 80);
    assert!(lines.iter().all(|line| line.chars().count() <= 80), "{lines:#?}");
    let text = lines.join("\n");
    for part in [
        "robot-2 coordinates, term 3, since 01:02:03.004",
        "successors: robot-3, robot-1",
        "offered to robot-3: it is preferred",
        "never by this policy: robot-4",
        "robot-3     650      800   900       -    600           -  preferred",
        "unfit: rssi",
    ] {
        assert!(text.contains(part), "{part}\n{text}");
    }
}

#[test]
fn nobody_and_a_suspended_holder_stand_first() {
    let mut view = view();
    view.role.suspended = true;
    assert!(screen(&view, None, 80)[0].starts_with("! robot-2 hears nobody"));
    view.role = RoleView::default();
    assert!(screen(&view, None, 80)[0].starts_with("! nobody is known to hold the role"));
}

#[test]
fn the_ranking_says_the_sum_the_bar_and_what_would_move_the_role() {
    let text = ranking(&view(), 200).join("\n");
    for part in [
        "1. robot-3: 650 of 1000 points, pinned as number 1",
        "2. robot-2: 875 of 1000 points, coordinator\n   battery 800 x 1 + links 900 x 3 = 3500, by 4",
        "unfit: rssi -85.0 dBm, bar -80.0 dBm",
        "-  robot-4: never, by the policy",
        "150 points ahead, or preferred, for 10 s",
    ] {
        assert!(text.contains(part), "{part}\n{text}");
    }
}

#[test]
fn since_when_is_what_the_holder_said_under_this_term() {
    let event = |robot: &str, term: f64, wall_ms| {
        let event = Event::new("role-taken", &RobotId::new(robot).unwrap(), "why");
        let event = event.number("term", term);
        EventView { sequence: 1, wall_ms, monotonic_ns: 0, event }
    };
    let events = [event("robot-2", 1.0, 10), event("robot-2", 3.0, 30), event("robot-1", 3.0, 40)];
    assert_eq!(Taken::of(&events, &view().role).unwrap().wall_ms, 30);
    assert_eq!(Taken::of(&events[..1], &view().role), None);
}
