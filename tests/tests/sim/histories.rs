//! Histories that once broke a rule, told again under other chances.

use std::time::Duration;

use sdr_core::recover::Cause;
use sdr_lab::sim::{
    Behaviour, DiskFate, Fault, Incident, Scenario, Setup, Telling, Way, Weather, check, systems,
};

/// Chances that each history is told under.
const CHANCES: std::ops::RangeInclusive<u64> = 1..=25;

fn at(ms: u64, fault: Fault) -> Incident {
    Incident { after: Duration::from_millis(ms), fault }
}

fn seconds(tenths: u64) -> Duration {
    Duration::from_millis(tenths * 100)
}

fn deploy(robot: usize, number: usize, components: usize) -> Fault {
    let needs = systems::fitting(3, 4, Setup::new(3, 1).memory, Setup::new(3, 1).cpu);
    let system = systems::chain(systems::name("system", number), components, needs);
    Fault::Deploy { robot, system: Box::new(system) }
}

fn power(robot: usize, down: Duration, disk: DiskFate) -> Fault {
    Fault::Crash { robot, down: Some(down), disk }
}

fn cut(inside: &[usize], time: Duration) -> Fault {
    Fault::Cut { inside: inside.to_vec(), way: Way::Both, time }
}

/// Tells a history under each chance; the rules that broke.
fn broken(robots: usize, loss: f64, calm_after: Duration, incidents: &[Incident]) -> Vec<String> {
    let mut broken = Vec::new();
    for seed in CHANCES {
        let scenario = Scenario {
            seed,
            robots,
            weather: Weather { loss, ..Weather::fair() },
            places: Vec::new(),
            drift_ppm_max: 100,
            incidents: incidents.to_vec(),
            calm_after,
        };
        let outcome = scenario.run(Telling::Silent);
        let found =
            outcome.violation().map(|found| format!("{seed}: {}, {}", found.rule, found.what));
        broken.extend(found);
    }
    broken
}

#[test]
fn one_revision_given_on_two_robots_leaves_one_whole_system() {
    let incidents =
        [at(5000, cut(&[2], seconds(60))), at(6000, deploy(0, 0, 4)), at(7000, deploy(2, 0, 2))];

    assert_eq!(broken(3, 0.0, seconds(150), &incidents), Vec::<String>::new());
}

#[test]
fn a_home_chosen_on_the_other_side_is_not_judged_by_old_news() {
    let incidents = [
        at(3900, deploy(1, 0, 4)),
        at(7000, deploy(1, 1, 2)),
        at(7600, deploy(1, 2, 2)),
        at(11_700, cut(&[0, 2, 4], seconds(129))),
    ];

    assert_eq!(broken(5, 0.0, seconds(400), &incidents), Vec::<String>::new());
}

#[test]
fn two_lost_disks_and_a_third_that_was_off_give_no_token_twice() {
    let incidents = [
        at(11_600, deploy(0, 0, 3)),
        at(15_500, power(2, seconds(233), DiskFate::Kept)),
        at(37_000, power(1, seconds(26), DiskFate::Lost)),
        at(38_000, power(0, seconds(16), DiskFate::Lost)),
    ];

    assert_eq!(broken(3, 0.0, seconds(420), &incidents), Vec::<String>::new());
}

#[test]
fn who_lost_its_disk_and_meets_one_that_missed_its_last_life_makes_no_number_twice() {
    let incidents = [
        at(4200, deploy(0, 0, 4)),
        at(30_500, cut(&[0], seconds(190))),
        at(32_100, power(1, seconds(81), DiskFate::Kept)),
        at(42_400, power(1, seconds(70), DiskFate::Lost)),
    ];

    assert_eq!(broken(3, 0.2, seconds(500), &incidents), Vec::<String>::new());
}

#[test]
fn who_runs_nowhere_may_go_back_to_a_robot_it_left_not_long_ago() {
    let fails = Some((Duration::from_millis(600), Cause::HardwareLost));
    let behaviour = Behaviour { fail_after: fails, ..Behaviour::default() };
    let component = String::from("c0");
    let faded = |robot| Fault::Fade { robot, level_dbm: -84, time: seconds(91) };
    // whichever of the two is home, it leaves it and fails on the other one
    let ill = |robot| {
        let (component, behaviour) = (component.clone(), behaviour.clone());
        Fault::Behave { robot, component, behaviour, time: seconds(49) }
    };
    for home in [0, 1] {
        let incidents =
            [at(4300, deploy(0, 0, 3)), at(12_500, faded(home)), at(15_200, ill(1 - home))];

        assert_eq!(broken(2, 0.05, seconds(500), &incidents), Vec::<String>::new());
    }
}

#[test]
fn a_fleet_that_lost_all_its_disks_is_a_new_one() {
    let incidents = [
        at(48_500, power(0, seconds(15), DiskFate::Lost)),
        at(48_800, power(1, seconds(12), DiskFate::Lost)),
    ];

    assert_eq!(broken(2, 0.2, seconds(520), &incidents), Vec::<String>::new());
}

#[test]
fn a_role_under_way_to_its_next_holder_is_not_held_by_two() {
    let mut fleet = sdr_lab::sim::Fleet::new(Setup::new(3, 1));
    (0..3).for_each(|robot| fleet.switch_on(robot));
    fleet.run(Duration::from_secs(20));
    let mut coordinators = check::Coordinators::default();
    let holder = fleet.highest_coordinator().unwrap();

    fleet.move_role((holder + 1) % 3, (holder + 1) % 3);
    let mut found = Vec::new();
    for _ in 0..2000 {
        fleet.run(Duration::from_millis(5));
        found.extend(sdr_lab::sim::Checker::watch(
            &mut coordinators,
            &fleet,
            &sdr_lab::sim::Sight::Look,
        ));
    }

    assert_eq!((fleet.highest_coordinator(), found), (Some((holder + 1) % 3), Vec::new()));
}
