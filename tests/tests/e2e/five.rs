//! Five robots, one of them the coordinator, to which the worst happens.

use std::{collections::BTreeMap, fs, time::Duration};

use sdr_core::api::RoleView;
use sdr_tests::house::{Agent, House, exploration, is_running, wait_for};

/// How long the coordinator's agent stands still: less than until it counts as gone.
const FROZEN: Duration = Duration::from_secs(10);

fn role(agent: &Agent) -> Option<RoleView> {
    let output = agent.sdr(&["role", "-o", "json"]);
    serde_json::from_slice(&output.stdout).ok()
}

/// Holder and term, when all these agents say the same and exactly one robot acts.
fn agreed<'a>(agents: impl IntoIterator<Item = &'a Agent>) -> Option<(String, u64)> {
    let views: Option<Vec<RoleView>> = agents.into_iter().map(role).collect();
    let views = views?;
    let first = views.first()?;
    let same = |view: &RoleView| view.holder == first.holder && view.term == first.term;
    views.iter().all(same).then_some(())?;
    Some((first.holder.clone()?, first.term))
}

/// Five robots with the paper's system on them; the coordinator's number.
fn deployed(gone_after: &str) -> (House, usize) {
    let mut house = House::build(5);
    for agent in &house.agents {
        agent.rewrite("gone_after = \"4s\"", &format!("gone_after = \"{gone_after}\""));
    }
    house.agents.iter_mut().for_each(Agent::start);
    house.wait("five robots with a coordinator", |house| {
        (0..5).all(|number| house.sees(number, 5)) && agreed(&house.agents).is_some()
    });
    let file = exploration();
    let output = house.agents[0].sdr(&["deploy", file.to_str().unwrap(), "--wait"]);
    let told = String::from_utf8_lossy(&output.stderr).into_owned();
    assert!(output.status.success(), "{told}\n{}", house.story());
    house.wait("all see it run, and one coordinator", |house| {
        (0..5).all(|number| house.is_running(number)) && agreed(&house.agents).is_some()
    });
    let (holder, _) = agreed(&house.agents).unwrap();
    let number = house.agents.iter().position(|agent| agent.name == holder).unwrap();
    (house, number)
}

/// (home, epoch, run) of each component.
fn homes(house: &House, seen_by: usize) -> BTreeMap<String, (Option<String>, u64, u32)> {
    let status = house.status(seen_by).unwrap();
    let components = status.systems.into_iter().flat_map(|system| system.components);
    components.map(|one| (one.name, (one.home, one.epoch, one.run))).collect()
}

/// Moves the role to a robot that is home to something, so that its fall is felt.
fn give_the_role_to(house: &House, number: usize) {
    let name = house.agents[number].name.clone();
    let moved = house.agents[number].sdr(&["role", "move", &name, "--wait"]);
    assert!(moved.status.success(), "{moved:?}\n{}", house.story());
    house
        .wait("all agree", |house| agreed(&house.agents).is_some_and(|(holder, _)| holder == name));
}

#[test]
fn a_coordinator_frozen_for_ten_seconds_splits_nothing_and_restarts_nothing() {
    // As by default: ten seconds are silence, not death.
    let (house, _) = deployed("11500ms");
    // robot-2 is home to camera and controller.
    give_the_role_to(&house, 1);
    let (_, term) = agreed(&house.agents).unwrap();
    let before = homes(&house, 0);
    let others: Vec<&Agent> =
        house.agents.iter().filter(|agent| agent.name != house.agents[1].name).collect();

    house.agents[1].freeze();
    let begun = std::time::Instant::now();
    house.wait("another robot takes over while it is frozen", |_| {
        agreed(others.iter().copied())
            .is_some_and(|(holder, now)| now > term && holder != house.agents[1].name)
    });
    let acted = wait_for(FROZEN, || begun.elapsed() >= FROZEN);
    assert!(acted);
    house.agents[1].release();

    house.wait("one coordinator, which all know, and all see the system run", |house| {
        (0..5).all(|number| house.is_running(number) && house.sees(number, 5))
            && agreed(&house.agents).is_some_and(|(_, now)| now > term)
    });
    // The wait ends at the first moment of agreement; it must be one that lasts.
    let settled = agreed(&house.agents).unwrap();
    let lasts = !wait_for(Duration::from_secs(3), || {
        agreed(&house.agents).is_some_and(|now| now != settled)
    });
    assert!(lasts, "the role moved on from {settled:?}\n{}", house.story());
    assert_eq!(homes(&house, 0), before, "{}", house.story());
    for agent in &house.agents {
        for kind in ["restart", "exited", "hung", "fenced", "move-started", "robot-gone"] {
            let told = agent.events(kind);
            assert!(told.is_empty(), "{}: {told:?}\n{}", agent.name, house.story());
        }
    }
}

#[test]
fn a_killed_coordinator_that_returns_with_an_empty_disk_follows_and_knows_everything() {
    let (mut house, _) = deployed("4s");
    give_the_role_to(&house, 1);
    let (_, term) = agreed(&house.agents).unwrap();
    let left = house.agents[1].component_pid("camera").unwrap();
    let epoch = homes(&house, 0)["camera"].1;
    let others = |house: &House| {
        let names = [0, 2, 3, 4];
        agreed(names.map(|number| &house.agents[number]))
    };

    house.agents[1].kill();
    house.wait("another coordinator, and its components elsewhere", |house| {
        others(house).is_some_and(|(holder, now)| now > term && holder != "robot-2")
            && homes(house, 0).values().all(|(home, ..)| home.as_deref() != Some("robot-2"))
            && house.is_running(0)
    });
    let (after, moved) = (homes(&house, 0), others(&house).unwrap());
    assert!(after["camera"].1 > epoch, "{after:?}");

    fs::remove_dir_all(house.agents[1].state()).unwrap();
    house.agents[1].start();
    house.wait("it follows the holder, knows the system, and sees it run", |house| {
        (0..5).all(|number| house.is_running(number) && house.sees(number, 5))
            && agreed(&house.agents).as_ref() == Some(&moved)
    });
    house.wait("nothing of its former life runs on", |_| !is_running(left));
    assert_eq!(homes(&house, 1), after, "a move by the return\n{}", house.story());
    for number in [0, 2, 3, 4] {
        let told = house.agents[number].events("fenced");
        assert!(told.is_empty(), "{told:?}\n{}", house.story());
    }
}
