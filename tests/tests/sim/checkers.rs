//! Each checker against a history that breaks its rule.

use std::time::Duration;

use sdr_core::{
    api::DeployAnswer,
    id::{ComponentKey, RobotId},
    order::{Epoch, Token},
};
use sdr_lab::sim::{Behaviour, Checker, Fault, Fleet, Setup, Sight, Weather, check, systems};

fn fleet(robots: usize, weather: Weather) -> Fleet {
    let mut fleet = Fleet::new(Setup { weather, ..Setup::new(robots, 1) });
    (0..robots).for_each(|robot| fleet.switch_on(robot));
    fleet
}

/// Two robots that cannot hear each other, which nobody meant: truth calls them one side.
fn strangers() -> Fleet {
    let mut fleet = fleet(2, Weather { loss: 1.0, ..Weather::fair() });
    fleet.run(Duration::from_secs(30));
    fleet
}

/// Three robots that run a small system.
fn running() -> Fleet {
    let mut fleet = fleet(3, Weather::fair());
    fleet.run(Duration::from_secs(3));
    let needs = systems::fitting(3, 2, fleet.setup().memory, fleet.setup().cpu);
    fleet.deploy(0, &systems::chain(systems::name("system", 0), 2, needs));
    fleet.run(Duration::from_secs(5));
    assert_eq!(check::convergence::lacking(&fleet), None);
    fleet
}

fn key(fleet: &Fleet) -> ComponentKey {
    fleet.key(0).clone()
}

fn token(number: u64, run: u32) -> Token {
    Token { epoch: Epoch { number, minted_by: RobotId::new("robot-1").unwrap() }, run }
}

fn rule(checker: &mut impl Checker, fleet: &Fleet, sight: &Sight) -> Option<&'static str> {
    checker.watch(fleet, sight).map(|broken| broken.rule)
}

#[test]
fn a_consumer_that_goes_back_is_seen() {
    let fleet = fleet(2, Weather::fair());
    let mut tokens = check::Tokens::default();
    let accepted = |token| Sight::Accepted { robot: 0, instance: 1, connection: 0, token };

    assert_eq!(rule(&mut tokens, &fleet, &accepted(token(1, 1))), None);
    assert_eq!(rule(&mut tokens, &fleet, &accepted(token(2, 1))), None);
    assert_eq!(rule(&mut tokens, &fleet, &accepted(token(1, 7))), Some("token-decreased"));
}

#[test]
fn one_token_for_two_activations_is_seen() {
    let fleet = running();
    let mut tokens = check::Tokens::default();
    let active = |robot| Sight::Active { robot, instance: 1, component: 0, token: token(4, 1) };

    assert_eq!(rule(&mut tokens, &fleet, &active(0)), None);
    assert_eq!(rule(&mut tokens, &fleet, &active(0)), None);
    assert_eq!(rule(&mut tokens, &fleet, &active(1)), Some("token-reused"));
}

#[test]
fn what_a_robot_made_and_has_not_on_its_disk_is_seen() {
    let mut fleet = running();
    let mut orders = check::Orders::default();
    assert_eq!(rule(&mut orders, &fleet, &Sight::Look), None);

    fleet.strike(&Fault::Storm { loss: 1.0, time: Duration::from_secs(50) });
    let disk = sdr_lab::sim::DiskFate::Lost;
    fleet.strike(&Fault::Crash { robot: 0, down: Some(Duration::from_millis(10)), disk });
    fleet.run(Duration::from_millis(20));
    let pretends = Sight::On { robot: 0, disk_kept: true };
    assert_eq!(rule(&mut orders, &fleet, &pretends), Some("wire-before-disk"));
}

#[test]
fn two_coordinators_on_one_side_are_seen() {
    let mut fleet = strangers();
    let mut coordinators = check::Coordinators::default();
    // the record of a hand-over may be under way
    assert_eq!(rule(&mut coordinators, &fleet, &Sight::Look), None);

    fleet.run(Duration::from_secs(5));
    assert_eq!(rule(&mut coordinators, &fleet, &Sight::Look), Some("two-coordinators"));
}

#[test]
fn a_component_that_stays_without_a_home_is_seen() {
    let mut fleet = fleet(3, Weather::fair());
    let never = Behaviour { initialise: Duration::from_secs(1000), ..Behaviour::default() };
    for robot in &mut fleet.robots {
        robot.behaviours.insert("c0".into(), never.clone());
    }
    fleet.run(Duration::from_secs(3));
    let needs = systems::fitting(3, 1, fleet.setup().memory, fleet.setup().cpu);
    fleet.deploy(0, &systems::chain(systems::name("system", 0), 1, needs));
    let mut homeless = check::Homeless::default();

    let mut seen = Vec::new();
    for _ in 0..20 {
        fleet.run(Duration::from_secs(1));
        seen.extend(
            rule(&mut homeless, &fleet, &Sight::Look).map(|rule| (rule, fleet.age().as_secs())),
        );
    }
    assert_eq!(seen.first(), Some(&("homeless-too-long", 19)), "{seen:?}");
}

#[test]
fn a_restart_after_a_heal_is_seen() {
    let mut fleet = running();
    let component = key(&fleet).name.to_string();
    let mut heals = check::Heals::default();
    fleet.strike(&Fault::Deaf { robot: 2, time: Duration::from_millis(1) });
    fleet.run(Duration::from_millis(1));
    assert_eq!(rule(&mut heals, &fleet, &Sight::Healed), None);

    // what the brains say of it is kept from the checker
    fleet.run(Duration::from_secs(1));
    let before = fleet.active(&key(&fleet)).to_vec();
    kill(&mut fleet, &component);
    fleet.run(Duration::from_secs(13));

    assert_ne!(fleet.active(&key(&fleet)), before);
    assert_eq!(rule(&mut heals, &fleet, &Sight::Look), Some("restarted-by-heal"));
}

/// Ends the processes of a component as if by themselves, which is no disturbance.
fn kill(fleet: &mut Fleet, component: &str) {
    for robot in 0..fleet.robots.len() {
        fleet.kill(robot, component);
    }
}

#[test]
fn a_deployment_that_was_answered_for_and_forgotten_is_seen() {
    let fleet = running();
    let mut deployments = check::Deployments::default();
    let answer = DeployAnswer { system: "system7".into(), revision: 1, changed: true };
    let answered = Sight::Answered { robot: 1, answer: Ok(answer) };

    assert_eq!(rule(&mut deployments, &fleet, &answered), None);
    assert_eq!(rule(&mut deployments, &fleet, &Sight::Look), Some("deployment-lost"));
}

#[test]
fn a_robot_that_floods_the_radio_is_seen() {
    let mut fleet = running();
    let mut bounds = check::Bounds::default();
    assert_eq!(rule(&mut bounds, &fleet, &Sight::Look), None);

    fleet.run(Duration::from_secs(5));
    assert_eq!(rule(&mut bounds, &fleet, &Sight::Look), None);
    fleet.run(Duration::from_secs(5));
    fleet.tally.sent_bytes[1] += 5_000_000;
    assert_eq!(rule(&mut bounds, &fleet, &Sight::Look), Some("unbounded"));
}

#[test]
fn what_is_not_right_in_the_end_is_named() {
    let mut fleet = running();
    assert_eq!(check::convergence::lacking(&fleet), None);

    kill(&mut fleet, "c1");
    let lacking = check::convergence::lacking(&fleet).unwrap();
    assert_eq!(lacking, "system0/c1 is active 0 times");
    let lacking = check::convergence::lacking(&strangers()).unwrap();
    assert_eq!(lacking, "robot-2 follows robot-2, not robot-1");
}
