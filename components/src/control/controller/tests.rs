use super::*;
use crate::control::path::After;

const HERE: Pose = Pose { x: 5.0, y: -0.8, yaw: 0.0 };

fn controller() -> Controller {
    let corners = vec![[0.0, -2.0], [30.0, -2.0], [30.0, 2.0], [0.0, 2.0]];
    let area = Area::new(corners).expect("a rectangle is an area");
    Controller::new(Settings::in_area(area), Path::tunnel_loop()).expect("the usual limits hold")
}

fn ms(count: u64) -> Duration {
    Duration::from_millis(count)
}

/// Orders every 20 ms with a fresh pose each time.
fn run(controller: &mut Controller, from_ms: u64, until_ms: u64, pose: Pose) -> Vec<Order> {
    let times = (from_ms..until_ms).step_by(20).map(ms);
    times
        .map(|now| {
            controller.handle_pose(now, pose);
            controller.order(now)
        })
        .collect()
}

#[test]
fn without_a_pose_nothing_moves() {
    let order = controller().order(ms(0));

    assert_eq!(order, Order { linear: 0.0, angular: 0.0, verdict: Verdict::NoPose });
}

#[test]
fn speed_grows_within_its_limit_and_stays_at_the_maximum() {
    let mut controller = controller();

    let orders = run(&mut controller, 0, 2000, HERE);

    for pair in orders.windows(2) {
        assert!(pair[1].linear - pair[0].linear <= 0.5 * 0.02 + 1e-9);
    }
    assert!((orders[orders.len() - 1].linear - 0.3).abs() < 1e-6);
}

#[test]
fn danger_stops_the_rover_until_it_was_away_for_the_hold() {
    let mut controller = controller();
    run(&mut controller, 0, 2000, HERE);
    controller.handle_danger(ms(2000), true);

    let stopping = run(&mut controller, 2000, 2400, HERE);
    controller.handle_danger(ms(2400), true);
    controller.handle_danger(ms(2500), false);
    let held = run(&mut controller, 2400, 3400, HERE);
    controller.handle_danger(ms(3400), false);
    let after = run(&mut controller, 3400, 4000, HERE);

    assert_eq!(stopping[stopping.len() - 1].linear, 0.0);
    for pair in stopping.windows(2) {
        assert!(pair[0].linear - pair[1].linear <= 1.5 * 0.02 + 1e-9);
    }
    assert!(held.iter().all(|order| order.verdict == Verdict::Danger && order.linear == 0.0));
    assert!(after.iter().all(|order| order.verdict == Verdict::Drive));
    assert!(after[after.len() - 1].linear > 0.2);
}

#[test]
fn a_detector_that_falls_silent_stops_the_rover_until_it_speaks_again() {
    let mut controller = controller();
    let without = run(&mut controller, 0, 2000, HERE);
    controller.handle_danger(ms(2000), false);

    let driving = run(&mut controller, 2000, 3020, HERE);
    let blind = run(&mut controller, 3020, 4000, HERE);
    controller.handle_danger(ms(4000), false);
    let after = run(&mut controller, 4000, 4100, HERE);

    assert!(without.iter().chain(&driving).all(|order| order.verdict == Verdict::Drive));
    assert!(blind.iter().all(|order| order.verdict == Verdict::Blind));
    assert_eq!(blind[blind.len() - 1].linear, 0.0);
    assert!(after.iter().all(|order| order.verdict == Verdict::Drive));
}

#[test]
fn outside_the_area_the_rover_stops() {
    let mut controller = controller();
    run(&mut controller, 0, 1000, HERE);

    let outside = run(&mut controller, 1000, 2000, Pose { y: 2.5, ..HERE });
    let inside = run(&mut controller, 2000, 2100, HERE);

    assert!(outside.iter().all(|order| order.verdict == Verdict::Outside));
    assert_eq!((outside[49].linear, outside[49].angular), (0.0, 0.0));
    assert_eq!(inside[0].verdict, Verdict::Drive);
}

#[test]
fn a_pose_that_grows_old_stops_the_rover() {
    let mut controller = controller();
    run(&mut controller, 0, 1000, HERE);

    assert_eq!(controller.order(ms(1480)).verdict, Verdict::Drive);
    assert_eq!(controller.order(ms(1481)).verdict, Verdict::NoPose);
    controller.handle_pose(ms(1490), Pose { x: f64::NAN, ..HERE });
    assert_eq!(controller.order(ms(1490)).verdict, Verdict::NoPose);
}

#[test]
fn the_end_of_a_path_is_arrival() {
    let path = Path::new(vec![[4.0, -0.8], [5.0, -0.8]], After::Stop).unwrap();
    let settings = controller().settings;
    let mut controller = Controller::new(settings, path).unwrap();

    let order = run(&mut controller, 0, 20, HERE)[0];

    assert_eq!(order.verdict, Verdict::Arrived);
}

#[test]
fn a_successor_goes_on_at_the_same_speed_and_minds_the_same_danger() {
    let mut old = controller();
    run(&mut old, 0, 2000, HERE);
    old.handle_danger(ms(2000), true);
    let saved = serde_json::to_string(&old.progress(ms(2400))).unwrap();
    let mut new = controller();

    // The successor's clock shows something else.
    new.resume(ms(90_000), &serde_json::from_str(&saved).unwrap());

    assert_eq!(run(&mut new, 90_000, 90_600, HERE)[29].verdict, Verdict::Danger);
    assert_eq!(run(&mut new, 90_600, 90_620, HERE)[0].verdict, Verdict::Drive);
    assert_eq!(new.progress(ms(90_620)).along_m, old.progress(ms(2400)).along_m);
}

#[test]
fn settings_out_of_range_are_refused_by_name() {
    let mut settings = controller().settings;
    settings.guide.speed_max = 30.0;

    let error = Controller::new(settings, Path::tunnel_loop()).unwrap_err();

    assert_eq!(error.to_string(), "speed_max is 30, allowed are 0.01 to 2 (SI units)");
}
