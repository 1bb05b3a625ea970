//! Where robots are: found without seeds, remembered, and found again when they moved.

use sdr_tests::house::{Agent, House};

/// Forgets the seeds of these agents, which were not started.
fn without_seeds(house: &House, numbers: impl IntoIterator<Item = usize>) {
    for number in numbers {
        let text = std::fs::read_to_string(house.agents[number].folder.join("robot.toml")).unwrap();
        let seeds = text.lines().find(|line| line.starts_with("seeds = ")).unwrap();
        house.agents[number].rewrite(seeds, "seeds = []");
    }
}

#[test]
fn robots_without_seeds_find_each_other_on_the_local_network() {
    let mut house = House::build(3);
    without_seeds(&house, 0..3);
    for agent in &house.agents {
        agent.rewrite("seeds = []", "seeds = []\ndiscovery = true");
    }

    house.agents.iter_mut().for_each(Agent::start);

    house.wait("all see all", |house| (0..3).all(|number| house.sees(number, 3)));
}

#[test]
fn who_does_not_look_and_has_no_seeds_stays_alone() {
    let mut house = House::build(2);
    without_seeds(&house, 0..2);
    house.agents[0].rewrite("seeds = []", "seeds = []\ndiscovery = true");

    house.agents.iter_mut().for_each(Agent::start);
    house.wait("both run", |house| (0..2).all(|number| house.status(number).is_some()));
    // The one that looks has spoken to the group for some time.
    house.wait("one looks", |house| {
        house.agents[0].health()["mesh"]["sent"].as_u64().unwrap_or(0) >= 8
    });

    assert!((0..2).all(|number| house.status(number).unwrap().robots.len() == 1));
    assert_eq!(house.agents[1].health()["mesh"]["received"], 0);
}

#[test]
fn a_robot_that_returns_elsewhere_without_seeds_is_found_by_what_it_remembers() {
    let mut house = House::start(3);
    let events = house.agents[0].events("robot-gone").len();
    house.agents[2].stop();
    house.wait("it is missed", |house| [0, 1].into_iter().all(|number| house.sees(number, 2)));

    without_seeds(&house, [2]);
    house.agents[2].move_away();
    house.agents[2].start();

    house.wait("all see all", |house| (0..3).all(|number| house.sees(number, 3)));
    // Not only for a moment, while it knocks: they speak to its new address.
    let sent = house.agents[2].health()["mesh"]["received"].as_u64().unwrap();
    house.wait("it is spoken to", |house| {
        house.agents[2].health()["mesh"]["received"].as_u64().unwrap_or(0) > sent + 20
    });
    assert_eq!(house.agents[0].events("robot-gone").len(), events + 1, "{}", house.story());
}
