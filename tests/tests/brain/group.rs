//! Robots that nobody told of others, and that look for some.

use std::{net::SocketAddr, time::Duration};

use sdr_core::{
    brain::{Brain, BrainConfig},
    effect::Effect,
    input::Input,
    report::HostReport,
    time::Instant,
};
use sdr_tests::fleet::Fleet;

use super::policies::seams;

/// The life that a robot with an empty disk lives after some time in which nobody is heard, and
/// how often it spoke to the group.
fn alone(group: Option<SocketAddr>, time: Duration) -> (u64, usize) {
    let facts = Fleet::new(1, 1).robots[0].facts.clone();
    let config = BrainConfig { group, ..BrainConfig::new("robot-1".parse().unwrap(), facts) };
    let start = Instant::from_millis(1000);
    let mut brain = Brain::new(config, seams(), None, start);
    let (mut now, mut life, mut sent) = (start, 0, 0);
    while now < start + time {
        now = now + Duration::from_millis(100);
        brain.handle(now, Input::Host(HostReport::default()));
        while let Some(effect) = brain.poll_effect() {
            match effect {
                Effect::Store { ticket, change } => {
                    life = change.incarnation;
                    brain.handle(now, Input::Stored { ticket });
                }
                Effect::Send { to, .. } if Some(to) == group => sent += 1,
                Effect::Send { .. }
                | Effect::Fetch { .. }
                | Effect::Launch(_)
                | Effect::Command { .. }
                | Effect::Routes(_)
                | Effect::Plan { .. }
                | Effect::Ask(_)
                | Effect::Answer { .. }
                | Effect::Event(_) => {}
            }
        }
    }
    (life, sent)
}

#[test]
fn who_looks_for_others_does_not_take_itself_for_new_before_it_looked() {
    let group = Some(SocketAddr::from(([239, 83, 1, 2], 7599)));

    let (life, sent) = alone(None, Duration::from_secs(1));
    assert_eq!((life, sent), (1, 0), "nobody to wait for");

    let (life, sent) = alone(group, Duration::from_secs(4));
    assert_eq!(life, 0, "others may know it");
    assert!(sent >= 8, "{sent} in 4 s");

    // It found nobody, which proves nothing.
    let (life, _) = alone(group, Duration::from_secs(6));
    assert!(life > 1 << 16, "{life}");
}
