//! Parts of systems that are longer than a record: they travel by themselves, and stay.

use std::{fs, path::PathBuf};

use sdr_core::lifecycle::LifecycleState;
use sdr_tests::house::{House, kill};

/// A component that says how long its text is.
const KEEPER: &str = include_str!("keeper.py");
const TEXT_BYTES: usize = 200_000;

/// A text that does not repeat itself.
fn text(length: usize) -> String {
    let words =
        (0_u64..).map(|number| format!("{:016x} ", number.wrapping_mul(0x9e37_79b9_7f4a_7c15)));
    let mut text = String::with_capacity(length + 17);
    for word in words {
        if text.len() >= length {
            break;
        }
        text.push_str(&word);
    }
    text.truncate(length);
    text
}

/// A system of one component with that text.
fn library(house: &House, length: usize) -> PathBuf {
    let file = house.folder().join("library.yaml");
    let component = "keeper: { run: { native: keeper }, rate: 10Hz, parameters: { text: \"";
    let system = format!("system: library\ncomponents:\n  {component}{}\" }} }}\n", text(length));
    fs::write(&file, system).unwrap();
    file
}

fn deploy(house: &House, length: usize) -> (bool, String) {
    let file = library(house, length);
    let deployed = house.agents[0].sdr(&["deploy", file.to_str().unwrap(), "--wait"]);
    let told = [&deployed.stdout[..], &deployed.stderr].concat();
    (deployed.status.success(), String::from_utf8_lossy(&told).into_owned())
}

/// Where the keeper is active, as a robot sees it.
fn home(house: &House, seen_by: usize) -> Option<String> {
    let status = house.status(seen_by)?;
    let component = status.systems.into_iter().next()?.components.into_iter().next()?;
    component.home.filter(|_| component.state == Some(LifecycleState::Active))
}

/// What the keeper said last on a robot.
fn said(house: &House, number: usize) -> String {
    let logs = house.agents[number].sdr(&["logs", "library/keeper", "--lines", "1"]);
    String::from_utf8_lossy(&logs.stdout).into_owned()
}

/// Files with large parts on a robot's disk.
fn parts(house: &House, number: usize) -> Vec<u64> {
    let files = fs::read_dir(house.agents[number].state().join("parts")).unwrap().flatten();
    files.map(|file| file.metadata().unwrap().len()).collect()
}

#[test]
fn a_component_with_a_large_parameter_starts_elsewhere_when_its_robot_dies() {
    let mut house = House::start(3);
    for agent in &house.agents {
        agent.install_script("keeper", KEEPER);
    }
    let (fine, told) = deploy(&house, TEXT_BYTES);
    assert!(fine, "{told}\n{}", house.story());
    assert_eq!(home(&house, 0).as_deref(), Some("robot-1"));
    let first = said(&house, 0);
    assert!(first.contains(&format!("{TEXT_BYTES} bytes, ")), "{first}");
    // All fetch it at once, so that its holder may die.
    house.wait("all have it on the disk", |house| {
        (0..3).all(|number| matches!(parts(house, number)[..], [one] if one > TEXT_BYTES as u64))
    });

    let left = house.agents[0].component_pid("keeper").unwrap();
    house.agents[0].kill();
    kill(left);

    house.wait("it runs elsewhere", |house| home(house, 1).is_some_and(|home| home != "robot-1"));
    let next = if home(&house, 1).as_deref() == Some("robot-2") { 1 } else { 2 };
    assert_eq!(said(&house, next), first, "{}", house.story());

    let gone = house.agents[1].sdr(&["undeploy", "library"]);
    assert!(gone.status.success(), "{gone:?}");
    house.wait("nobody keeps what nobody names", |house| {
        [1, 2].into_iter().all(|number| parts(house, number).is_empty())
    });
}

#[test]
fn a_part_over_the_bound_is_refused_with_place_found_and_allowed() {
    let house = House::start(1);
    house.agents[0].install_script("keeper", KEEPER);

    let (fine, told) = deploy(&house, 1_100_000);

    assert!(!fine, "{told}");
    for word in ["library/keeper", "1100", "at most 1048576"] {
        assert!(told.contains(word), "{word}: {told}");
    }
    assert_eq!(parts(&house, 0), [0_u64; 0]);
    assert!(house.status(0).unwrap().systems.is_empty());
}
