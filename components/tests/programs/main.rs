//! The five programs as processes, in the lab's world, over real shared memory.
#![expect(
    clippy::unwrap_used,
    clippy::wildcard_enum_match_arm,
    reason = "what a test cannot go on without, and words it does not wait for"
)]

mod robot;

use std::process::Command;
use std::time::{Duration, Instant};

use robot::{Robot, executable};
use sdr_component::protocol::Order;
use sdr_core::{
    lifecycle::LifecycleState,
    recover::Cause,
    spec::{ComponentProfile, Value},
};

const ALL: [&str; 5] = ["fisheye", "anomaly", "camera", "position", "controller"];

/// Waits for the world to be so; panics when it never is.
fn eventually(what: &str, mut holds: impl FnMut() -> bool) {
    let start = Instant::now();
    while !holds() {
        assert!(start.elapsed() < Duration::from_secs(60), "never: {what}");
        std::thread::sleep(Duration::from_millis(20));
    }
}

#[test]
fn each_program_describes_itself_without_an_agent() {
    for name in ALL {
        let output = Command::new(executable(name)).arg("--describe").output().unwrap();
        let profile: ComponentProfile = serde_json::from_slice(&output.stdout).unwrap();
        assert!(output.status.success() && profile.name == name && !profile.about.is_empty());
        assert!(!profile.outputs.is_empty());
        let ballast =
            profile.parameters.iter().filter(|known| known.name == "ballast_bytes").count();
        assert_eq!(ballast, 1);
    }
}

#[test]
fn without_an_agent_a_program_says_what_is_missing() {
    let output = Command::new(executable("anomaly")).env_remove("SDR_SOCKET").output().unwrap();
    let words = String::from_utf8(output.stderr).unwrap();
    assert_eq!(output.status.code(), Some(2));
    assert!(words.contains("SDR_SOCKET") && words.contains("--describe"), "{words}");
}

#[test]
fn the_five_drive_the_rover_stop_it_for_danger_and_leave_it_standing() {
    let robot = Robot::new();
    let rover = || robot.world.snapshot().rovers[0].clone();
    let mut programs: Vec<_> = ALL
        .iter()
        .map(|name| {
            let (program, state) = robot.start(name, &[]);
            assert_eq!(state.state, LifecycleState::Inactive, "{name}: {state:?}");
            program
        })
        .collect();
    for program in &mut programs {
        program.activate();
    }

    let connections: usize =
        programs.iter_mut().map(|program| program.until_accepted(10).len()).sum();
    assert_eq!(connections, 5);
    eventually("the rover drives", || rover().distance_m > 0.2);
    robot.world.place_object_ahead("robot-1", 2.5).unwrap();
    eventually("it stops before the box", || !rover().driving && rover().stops == 1);
    robot.world.remove_object();
    eventually("it goes on", || rover().driving);

    let mut controller = programs.pop().unwrap();
    controller.order(Order::Deactivate);
    controller.until_state(LifecycleState::Inactive);
    eventually("it stands", || !rover().driving);
    controller.order(Order::Finish);
    assert!(controller.has_ended_well());
}

#[test]
fn a_lost_device_is_an_error_with_its_cause_and_a_reset_brings_it_back() {
    let robot = Robot::new();
    let wheels = robot.world.paths()[0].wheels.clone();
    let aside = wheels.with_extension("aside");
    std::fs::rename(&wheels, &aside).unwrap();

    let (mut program, state) = robot.start("controller", &[]);
    let fault = state.fault.unwrap();
    assert_eq!((state.state, fault.cause), (LifecycleState::Error, Cause::HardwareLost));
    assert!(fault.reason.contains("no device at"), "{}", fault.reason);

    std::fs::rename(&aside, &wheels).unwrap();
    program.order(Order::Reset);
    program.until_state(LifecycleState::Inactive);
    program.activate();
}

#[test]
fn a_camera_replays_a_folder_without_any_device() {
    let robot = Robot::new();
    let folder = robot.folder().join("pictures");
    std::fs::create_dir(&folder).unwrap();
    let images = ("images", Value::Text(folder.to_str().unwrap().to_owned()));
    let (_empty, state) = robot.start("camera", std::slice::from_ref(&images));
    assert_eq!(state.state, LifecycleState::Error);
    assert!(state.fault.unwrap().reason.contains("has 0 pictures"));

    image::RgbImage::from_pixel(400, 300, image::Rgb([9, 9, 9]))
        .save(folder.join("a.jpg"))
        .unwrap();
    let (mut fisheye, state) = robot.start("fisheye", &[images]);
    assert_eq!(state.state, LifecycleState::Inactive, "{state:?}");
    let (mut anomaly, _) = robot.start("anomaly", &[]);
    anomaly.activate();
    fisheye.activate();
    anomaly.until_accepted(3);
}

#[test]
fn parameters_that_make_no_sense_are_named() {
    let robot = Robot::new();
    let corner = |x| Value::List(vec![Value::Float(x), Value::Float(0.0)]);
    let line = Value::List(vec![corner(0.0), corner(1.0), corner(2.0)]);
    for (name, parameter, value, words) in [
        ("anomaly", "object", Value::Text(String::from("cat")), "allowed: red_box"),
        ("controller", "area", line, "one line"),
    ] {
        let (_program, state) = robot.start(name, &[(parameter, value)]);
        let reason = state.fault.unwrap().reason;
        assert!(reason.contains(words), "{reason}");
    }
}
