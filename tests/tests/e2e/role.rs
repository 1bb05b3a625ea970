//! The coordinator role with real agents: given by hand, and taken over from a killed holder.

use sdr_core::api::RoleView;
use sdr_tests::house::{Agent, House};

/// `sdr role -o json`: what this agent believes; `None` while it does not answer.
fn role(agent: &Agent) -> Option<RoleView> {
    let output = agent.sdr(&["role", "-o", "json"]);
    serde_json::from_slice(&output.stdout).ok()
}

/// Whether these agents all see this robot hold the role under one term, at least this one.
fn agree<'a>(agents: impl IntoIterator<Item = &'a Agent>, holder: &str, term: u64) -> bool {
    let views: Option<Vec<RoleView>> = agents.into_iter().map(role).collect();
    let Some(views) = views else { return false };
    views.iter().all(|view| {
        view.holder.as_deref() == Some(holder) && view.term >= term && view.term == views[0].term
    })
}

fn number_of(house: &House, name: &str) -> usize {
    house.agents.iter().position(|agent| agent.name == name).unwrap()
}

/// Whether every agent knows what to think of all three, and who follows.
fn is_settled(house: &House) -> bool {
    house.agents.iter().all(|agent| {
        role(agent).is_some_and(|role| role.candidates.len() == 3 && role.successors.len() == 2)
    })
}

/// The terms that an agent says it began to act under.
fn taken(agent: &Agent) -> Vec<f64> {
    let events = agent.events("role-taken");
    events.iter().filter_map(|view| view.event.numbers.get("term").copied()).collect()
}

#[test]
fn the_role_is_given_by_hand_and_all_robots_agree() {
    let house = House::start(3);
    house.wait("all know all", is_settled);
    let before = role(&house.agents[0]).unwrap();
    let old = number_of(&house, before.holder.as_ref().unwrap());
    let (next, asked) = ((old + 1) % 3, (old + 2) % 3);
    let name = house.agents[next].name.clone();

    let output = house.agents[asked].sdr(&["role", "move", &name, "--wait", "-o", "json"]);
    let told = String::from_utf8_lossy(&output.stderr);
    assert!(output.status.success(), "{told}\n{}", house.story());
    let answer: serde_json::Value = serde_json::from_slice(&output.stdout).unwrap();
    assert_eq!((&answer["holder"], &answer["done"]), (&name.clone().into(), &true.into()));
    let term = answer["term"].as_u64().unwrap();
    assert!(term > before.term, "{answer}");

    house.wait("all agree on the new holder, which names its successors", |house| {
        agree(&house.agents, &name, term)
            && house.agents.iter().all(|agent| {
                role(agent).is_some_and(|view| view.by_operator && view.successors.len() == 2)
            })
    });
    house.wait("the new holder acts", |house| !taken(&house.agents[next]).is_empty());
    let first = taken(&house.agents[next])[0];
    let kept = taken(&house.agents[old]).into_iter().filter(|term| *term >= first).count();
    assert_eq!(kept, 0, "the old holder acts on: {}", house.story());
    let moved = house.agents[asked].events("role-moved");
    assert_eq!(moved.len(), 1, "{}", house.story());

    let refused = house.agents[asked].sdr(&["role", "move", "robot-9"]);
    let told = String::from_utf8_lossy(&refused.stderr);
    assert_eq!(refused.status.code(), Some(1));
    assert!(
        told.contains("robot-9 is not alive here; alive: [robot-1, robot-2, robot-3]"),
        "{told}"
    );
}

#[test]
fn another_robot_takes_over_from_a_killed_holder() {
    let mut house = House::start(3);
    house.wait("all know all", is_settled);
    let before = role(&house.agents[0]).unwrap();
    let old = number_of(&house, before.holder.as_ref().unwrap());
    let left: Vec<usize> = (0..3).filter(|number| *number != old).collect();

    house.agents[old].kill();

    house.wait("both others agree on one of them", |house| {
        left.iter().any(|next| {
            let agents = left.iter().map(|number| &house.agents[*number]);
            agree(agents, &house.agents[*next].name, before.term + 1)
        })
    });
    let after = role(&house.agents[left[0]]).unwrap();
    let next = number_of(&house, after.holder.as_ref().unwrap());
    house.wait("the new holder acts and says why", |house| {
        let events = house.agents[next].events("role-taken");
        events.iter().any(|view| view.event.reason.contains("is silent for"))
    });

    house.agents[old].start();
    house.wait("the one that was killed follows", |house| {
        agree(&house.agents, &after.holder.clone().unwrap(), after.term)
    });
}

#[test]
fn a_policy_given_to_one_robot_is_in_force_on_all() {
    let house = House::start(3);
    house.wait("all know all", is_settled);
    let before = role(&house.agents[0]).unwrap();
    let old = before.holder.clone().unwrap();
    let file = house.folder().join("role.yaml");
    let text = format!("role: not-{old}\nextends: default\nforbidden: [{old}]\n");
    std::fs::write(&file, text).unwrap();

    let output = house.agents[0].sdr(&["role", "policy", file.to_str().unwrap()]);
    let told = String::from_utf8_lossy(&output.stderr);
    assert!(output.status.success(), "{told}\n{}", house.story());

    house.wait("the forbidden holder gave the role up, and all know the policy", |house| {
        house.agents.iter().all(|agent| {
            role(agent).is_some_and(|role| {
                role.policy == format!("not-{old}") && role.holder.as_ref() != Some(&old)
            })
        })
    });
    let why = house.agents[1].sdr(&["role", "why"]);
    let told = String::from_utf8_lossy(&why.stdout);
    assert!(told.contains(&format!("{old}: never, by the policy")), "{told}");
}
