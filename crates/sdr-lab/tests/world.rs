//! The world through its sockets and files, as components and agents see it.

use std::io::{BufRead, BufReader, Read, Write};
use std::os::unix::net::UnixStream;
use std::path::Path;
use std::time::Duration;

use sdr_lab::device::{CameraClient, Command, DeviceError, WheelsClient};
use sdr_lab::radio::Fade;
use sdr_lab::tunnel::{DangerousObject, Pose};
use sdr_lab::world::{RoverConfig, WorldError, monotonic_ns};
use sdr_lab::{World, WorldConfig, WorldHandle};

/// Far longer than anything here takes.
const LIMIT: Duration = Duration::from_secs(20);

fn world(folder: &Path) -> WorldHandle {
    World::start(WorldConfig::convoy(folder, "robot-2", &["robot-1", "robot-3"], 1))
        .expect("a fresh folder takes a world")
}

fn lines_of(path: &Path) -> (UnixStream, BufReader<UnixStream>) {
    let stream = UnixStream::connect(path).expect("the device listens");
    stream.set_read_timeout(Some(LIMIT)).expect("the limit is not zero");
    let mut lines = BufReader::new(stream.try_clone().expect("descriptors are left"));
    lines.read_line(&mut String::new()).expect("the device greets");
    (stream, lines)
}

#[test]
fn commands_drive_the_convoy_and_their_times_are_kept() {
    let folder = tempfile::tempdir().unwrap();
    let world = world(folder.path());
    let mut wheels = WheelsClient::connect(&world.paths()[0].wheels, LIMIT).unwrap();
    let from_ns = monotonic_ns();

    let mut way = 0.0;
    while way < 0.15 {
        wheels.command(Command { linear: 0.5, angular: 0.0 }).unwrap();
        let readings = wheels.wait(LIMIT).unwrap();
        way = readings.last().map_or(way, |reading| (reading.left_m + reading.right_m) / 2.0);
    }

    let snapshot = world.snapshot();
    for robot in ["robot-1", "robot-2", "robot-3"] {
        let rover = snapshot.rover(robot).unwrap();
        assert!(rover.distance_m > 0.1 && rover.driving, "{rover:?}");
    }
    let gaps = world.command_gaps("robot-2", from_ns, monotonic_ns()).unwrap().unwrap();
    assert!(gaps.count >= 10 && gaps.longest_ns >= gaps.median_ns && gaps.median_ns > 0);
    assert_eq!(world.command_times("robot-2").unwrap().len(), gaps.count + 1);
    assert_eq!(world.command_gaps("robot-1", 0, u64::MAX).unwrap(), None);
}

#[test]
fn two_clients_of_a_camera_both_get_pictures() {
    let folder = tempfile::tempdir().unwrap();
    let world = world(folder.path());
    let path = &world.paths()[1].fisheye;
    let mut one = CameraClient::connect(path, LIMIT).unwrap();
    let mut two = CameraClient::connect(path, LIMIT).unwrap();

    for _ in 0..3 {
        let frames = [one.frame().unwrap(), two.frame().unwrap()];
        for frame in frames {
            assert_eq!((frame.picture.width, frame.picture.height), (240, 240));
            assert_eq!(frame.picture.rgb.len(), 240 * 240 * 3);
            assert!(frame.sequence >= 1 && frame.stamp_ns >= world.started_ns());
        }
    }
    assert_eq!(one.greeting().robot, "robot-1");
}

#[test]
fn bad_lines_are_answered_and_others_do_not_notice() {
    let folder = tempfile::tempdir().unwrap();
    let world = world(folder.path());
    let (mut stream, mut lines) = lines_of(&world.paths()[0].camera);
    let mut other = CameraClient::connect(&world.paths()[0].camera, LIMIT).unwrap();

    stream.write_all(b"{\"get\":\"money\"}\n").unwrap();
    let mut answer = String::new();
    lines.read_line(&mut answer).unwrap();
    assert!(answer.starts_with("{\"error\":\"line 1: unknown variant `money`"), "{answer}");
    stream.write_all(&[b'x'; 600]).unwrap();
    let mut rest = String::new();
    lines.read_to_string(&mut rest).unwrap();

    assert!(rest.contains("line 2: longer than 512 bytes"), "{rest}");
    assert!(other.frame().is_ok());
}

#[test]
fn wheels_refuse_what_is_no_command() {
    let folder = tempfile::tempdir().unwrap();
    let world = world(folder.path());
    let (mut stream, lines) = lines_of(&world.paths()[0].wheels);

    stream.write_all(b"{\"linear\":1e9,\"angular\":0}\n{\"linear\":1}\n").unwrap();
    let errors: Vec<String> =
        lines.lines().map(Result::unwrap).filter(|l| l.contains("error")).take(2).collect();

    assert!(
        errors[0].contains("line 1: linear is 1000000000, allowed are -10 to 10"),
        "{errors:?}"
    );
    assert!(errors[1].contains("line 2: missing field `angular`"), "{errors:?}");
    let mut client = WheelsClient::connect(&world.paths()[0].wheels, LIMIT).unwrap();
    let refused = client.command(Command { linear: f64::NAN, angular: 0.0 });
    assert!(matches!(refused, Err(DeviceError::OutOfRange { name: "linear", .. })));
    assert!(world.command_times("robot-2").unwrap().is_empty());
}

#[test]
fn a_client_of_the_wrong_device_is_told() {
    let folder = tempfile::tempdir().unwrap();
    let world = world(folder.path());

    let wrong = CameraClient::connect(&world.paths()[0].wheels, LIMIT).unwrap_err();
    let absent = WheelsClient::connect(&folder.path().join("none.sock"), LIMIT).unwrap_err();

    assert!(wrong.to_string().contains("is not a camera: it says"), "{wrong}");
    assert!(matches!(absent, DeviceError::Absent { .. }), "{absent}");
}

#[test]
fn a_fade_reaches_the_file_and_nobody_else() {
    let folder = tempfile::tempdir().unwrap();
    let world = world(folder.path());
    let level = |index: usize| -> i32 {
        let text = std::fs::read_to_string(&world.paths()[index].wireless).unwrap();
        let line = text.lines().nth(2).unwrap().to_owned();
        line.split_whitespace().nth(3).unwrap().trim_end_matches('.').parse().unwrap()
    };
    assert!((-50..=-44).contains(&level(1)), "{}", level(1));

    let over = Duration::from_millis(50);
    world.fade("robot-1", Fade { over, ..Fade::SHIELD }).unwrap();
    while level(1) > -53 {
        std::thread::yield_now();
    }

    assert!((-50..=-44).contains(&level(0)));
    assert_eq!(std::fs::read_to_string(&world.paths()[0].battery).unwrap(), "80\n");
    let unknown = world.fade("robot-9", Fade::SHIELD).unwrap_err();
    assert!(matches!(unknown, WorldError::UnknownRobot { .. }));
}

#[test]
fn stopping_removes_what_was_made_and_hangs_up() {
    let folder = tempfile::tempdir().unwrap();
    let world = world(folder.path());
    let mut wheels = WheelsClient::connect(&world.paths()[0].wheels, LIMIT).unwrap();
    wheels.wait(LIMIT).unwrap();

    world.stop();

    assert_eq!(std::fs::read_dir(folder.path()).unwrap().count(), 0);
    while wheels.readings().is_ok() {}
}

#[test]
fn the_object_is_seen_from_near_and_ahead_only() {
    let folder = tempfile::tempdir().unwrap();
    let world = world(folder.path());
    let visible = || world.snapshot().rover("robot-2").unwrap().object_visible;

    assert!(!visible());
    world.place_object_ahead("robot-2", 4.0).unwrap();
    assert!(visible());
    world.place_object(DangerousObject::at(20.0, 0.0)).unwrap();
    assert!(!visible());
    world.remove_object();
    assert_eq!(world.snapshot().object, None);
}

#[test]
fn an_impossible_world_is_refused_with_the_reason() {
    let folder = tempfile::tempdir().unwrap();
    let start = |names: &[&str], folder: &Path| {
        let rover = |name: &&str| RoverConfig::new(name, Pose::new(2.0, 0.0, 0.0));
        let rovers = names.iter().map(rover).collect();
        let config =
            WorldConfig { folder: folder.to_owned(), rovers, seed: 1, schedule: Vec::new() };
        World::start(config).map(drop).unwrap_err().to_string()
    };

    assert_eq!(start(&[], folder.path()), "0 robots, allowed are 1 to 64");
    assert_eq!(start(&["a", "a"], folder.path()), "two robots are named `a`");
    assert!(start(&["../a"], folder.path()).contains("allowed are letters, digits"));
    let deep = folder.path().join("x".repeat(90));
    assert!(start(&["a"], &deep).contains("a socket's path at most 107"));
    assert_eq!(std::fs::read_dir(folder.path()).unwrap().count(), 0);
}

#[test]
fn the_seventeenth_client_is_refused_and_a_free_place_is_taken_again() {
    let folder = tempfile::tempdir().unwrap();
    let world = world(folder.path());
    let path = &world.paths()[0].camera;
    let mut clients: Vec<CameraClient> =
        (0..16).map(|_| CameraClient::connect(path, LIMIT).unwrap()).collect();

    let (_stream, mut lines) = lines_of(path);
    let mut rest = String::new();
    lines.read_to_string(&mut rest).unwrap();

    assert_eq!(rest, "{\"error\":\"16 clients already, hanging up\"}\n");
    assert!(clients.iter_mut().all(|client| client.frame().is_ok()));
    clients.clear();
    while CameraClient::connect(path, LIMIT).and_then(|mut client| client.frame()).is_err() {}
}

#[test]
fn garbage_and_readers_that_never_read_disturb_nobody() {
    let folder = tempfile::tempdir().unwrap();
    let world = world(folder.path());
    let mut noise = sdr_lab::noise::Noise::new(8);
    let mut asleep = Vec::new();
    for round in 0..40 {
        let path = if round % 2 == 0 { &world.paths()[0].wheels } else { &world.paths()[0].camera };
        let mut stream = UnixStream::connect(path).unwrap();
        let bytes: Vec<u8> = (0..100).flat_map(|_| noise.bits().to_le_bytes()).collect();
        // The device may hang up while the garbage is on its way.
        let _ = stream.write_all(&bytes);
        if round % 10 == 0 {
            asleep.push(stream);
        }
    }

    // A device may still be hanging up on the noisy clients and have no room.
    let mut tries = 0;
    let (mut wheels, first) = loop {
        tries += 1;
        let drive = |mut wheels: WheelsClient| {
            wheels.command(Command { linear: 0.1, angular: 0.0 })?;
            let first = wheels.wait(LIMIT)?[0].sequence;
            Ok((wheels, first))
        };
        if let Ok(driving) = WheelsClient::connect(&world.paths()[0].wheels, LIMIT).and_then(drive)
        {
            break driving;
        }
    };
    while wheels.wait(LIMIT).unwrap().last().unwrap().sequence < first + 20 {}
    let mut camera = CameraClient::connect(&world.paths()[0].camera, LIMIT).unwrap();

    assert!(camera.frame().is_ok());
    assert!((1..=tries).contains(&world.command_times("robot-2").unwrap().len()));
}
