//! Who is taken for alive, and by whom.

use alloc::{string::ToString, vec::Vec};
use core::time::Duration;

use super::{super::*, Bench, address, robot};
use crate::units::Permille;

#[test]
fn a_silent_robot_is_gone_and_its_old_datagrams_do_not_revive_it() {
    let mut bench = Bench::new(3, 0);
    bench.run(Duration::from_secs(2));
    let replayed = bench.last[&2].clone();
    bench.meshes[2] = None;
    bench.run(Duration::from_secs(7));
    assert!(!bench.mesh(0).is_alive(&robot(2)));

    let now = bench.now;
    bench.mesh(0).handle_datagram(now, address(2), &replayed);
    assert!(!bench.mesh(0).is_alive(&robot(2)));
    assert!(bench.mesh(0).counters().stale > 0);
}

#[test]
fn a_pause_of_the_observer_buries_nobody() {
    let mut bench = Bench::new(2, 0);
    bench.run(Duration::from_secs(2));
    let pause = Duration::from_secs(60);
    let later = bench.now + pause;
    bench.mesh(0).forgive_pause(pause);
    bench.mesh(0).handle_tick(later);
    assert!(bench.mesh(0).is_alive(&robot(1)));
}

#[test]
fn links_are_measured() {
    let mut bench = Bench::new(2, 0);
    bench.run(Duration::from_secs(2));
    let links: Vec<_> = bench.mesh(0).links().map(|(robot, _)| robot.to_string()).collect();
    assert_eq!(links, ["robot-1"]);
}

#[test]
fn a_robot_is_quiet_before_it_is_gone() {
    let mut bench = Bench::new(5, 0);
    bench.run(Duration::from_secs(3));
    bench.meshes[4] = None;
    bench.news.clear();

    bench.run(Duration::from_millis(1300));
    assert_eq!(bench.mesh(0).standing(&robot(4)), Standing::Quiet);
    assert!(bench.mesh(0).is_alive(&robot(4)));
    bench.run(Duration::from_millis(3750));

    assert_eq!(bench.mesh(0).standing(&robot(4)), Standing::Gone);
    let of_it = |(by, news): &&(usize, MeshNews)| {
        *by == 0 && [MeshNews::Quiet(robot(4)), MeshNews::Gone(robot(4))].contains(news)
    };
    assert_eq!(bench.news.iter().filter(of_it).count(), 2);
}

#[test]
fn a_deaf_robot_says_so_and_buries_nobody() {
    let mut bench = Bench::new(5, 0);
    bench.run(Duration::from_secs(3));
    bench.silence(0);
    bench.run(Duration::from_secs(8));
    assert!(bench.mesh(0).is_isolated());
    assert_eq!(bench.mesh(0).alive().count(), 4);
    assert!(!bench.mesh(1).is_alive(&robot(0)));

    bench.cut.clear();
    bench.run(Duration::from_secs(5));
    assert!(bench.said(0, &MeshNews::Isolated) && bench.said(0, &MeshNews::Rejoined));
    assert!((1..5).all(|other| !bench.said(0, &MeshNews::Gone(robot(other)))));
    assert!(bench.mesh(1).is_alive(&robot(0)));
}

#[test]
fn the_only_other_robot_is_gone_when_it_is_silent() {
    let mut bench = Bench::new(2, 0);
    bench.run(Duration::from_secs(3));
    bench.meshes[1] = None;
    bench.run(Duration::from_millis(5100));
    assert_eq!(bench.mesh(0).standing(&robot(1)), Standing::Gone);
}

#[test]
fn a_link_that_works_one_way_is_seen_as_such() {
    let mut bench = Bench::new(3, 0);
    bench.run(Duration::from_secs(3));
    bench.cut.insert((0, 1));
    bench.run(Duration::from_secs(10));

    let link = |mesh: &mut Mesh, to: usize| {
        mesh.links().find(|(other, _)| **other == robot(to)).unwrap().1
    };
    let (out, back) = (link(bench.mesh(0), 1), link(bench.mesh(1), 0));
    assert_eq!((out.loss_out, out.loss_in), (Permille(1000), Permille(0)));
    assert_eq!(back.loss_in, Permille(1000));
    assert!(bench.mesh(1).is_alive(&robot(0)) && bench.mesh(0).is_alive(&robot(1)));
}

#[test]
fn others_are_asked_for_fresh_news() {
    let mut bench = Bench::new(6, 0);
    bench.run(Duration::from_secs(3));
    bench.cut.insert((5, 0));
    bench.run(Duration::from_millis(500));

    let now = bench.now;
    bench.mesh(0).ask_about(now, &robot(5));
    bench.deliver();

    let inquiry = bench.mesh(0).inquiry(&robot(5)).unwrap();
    assert_eq!((inquiry.asked, inquiry.answered), (4, 4));
    assert!(bench.mesh(0).age(&robot(5), now).unwrap() < Duration::from_millis(500));
    assert!(bench.mesh(0).hears_somebody(now, Duration::from_secs(1)));
}

#[test]
fn guard_beats_come_at_their_own_pace() {
    let mut bench = Bench::new(3, 0);
    bench.run(Duration::from_secs(2));
    let beats = BTreeMap::from([(robot(1), Duration::from_millis(50))]);
    bench.mesh(0).beat_to(BeatsFor::Standbys, beats);
    bench.run(Duration::from_secs(1));

    let now = bench.now;
    assert!(bench.mesh(1).age(&robot(0), now).unwrap() <= Duration::from_millis(50));
    let sent = bench.mesh(0).traffic();
    assert!((18..=22).contains(&sent.guard) && sent.guard_bytes < sent.guard * 60, "{sent:?}");

    bench.mesh(0).beat_to(BeatsFor::Standbys, BTreeMap::new());
    bench.run(Duration::from_secs(1));
    assert_eq!(bench.mesh(0).traffic().guard, sent.guard);
}
