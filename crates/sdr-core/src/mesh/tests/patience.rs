//! How long news may take before a robot is taken for gone.

use super::*;
use crate::mesh::{author_table::Seat, liveness::Liveness};

const GONE_AFTER: Duration = Duration::from_millis(11_500);

/// Everybody of a fleet was heard just now.
fn heard(robots: usize, now: Instant) -> Liveness {
    let mut liveness = Liveness::new(GONE_AFTER, Duration::from_millis(350), now);
    for seat in (0..robots).map(Seat::at) {
        liveness.reset(seat);
        if seat != Seat::OWN {
            liveness.hear(seat, 1, now, now);
        }
    }
    liveness
}

#[test]
fn where_others_know_other_robots_news_is_given_more_time() {
    let now = Instant::from_millis(1000);
    let mut liveness = heard(300, now);
    let before = (liveness.quiet(), liveness.gone());

    liveness.note_other_names(now);

    let during = (liveness.quiet(), liveness.gone());
    assert!(during.0 > before.0 * 2 && during.1 > before.1, "{during:?} after {before:?}");
    let soon = now + before.0 + Duration::from_secs(1);
    // somebody is heard: this robot is not deaf
    liveness.hear_directly(Seat::at(1), soon);
    assert_eq!(liveness.judge(soon), []);

    // what was said then has passed: as before
    let later = now + during.0;
    liveness.hear_directly(Seat::at(1), later);
    let fallen = liveness.judge(later);
    assert_eq!((liveness.quiet(), liveness.gone()), before);
    assert!(fallen.iter().all(|(_, standing)| *standing == Standing::Quiet));
    assert_eq!(fallen.len(), 299);
}

#[test]
fn small_fleets_are_told_whole_by_ids_too() {
    let now = Instant::from_millis(1000);
    let mut liveness = heard(30, now);
    let before = (liveness.quiet(), liveness.gone());

    liveness.note_other_names(now);

    assert_eq!((liveness.quiet(), liveness.gone()), before);
}

#[test]
fn a_ping_is_answered_with_fresh_news() {
    let mut bench = Bench::new(6, 0);
    bench.run(Duration::from_secs(3));

    let now = bench.now;
    bench.mesh(0).ping(now, &robot(5));
    bench.deliver();

    assert_eq!(bench.mesh(0).age(&robot(5), now), Some(Duration::ZERO));
}

#[test]
fn robots_have_places_by_name_in_whatever_order_they_are_met() {
    let me = RobotId::new("m").unwrap();
    let own = Incarnation::default();
    let mut table = AuthorTable::new(me, own, None);
    for name in ["z", "a", "q", "b", "mm", "l"] {
        table.admit(&RobotId::new(name).unwrap(), own);
    }

    let by_place = (0..7).map(|place| table.at_place(place).unwrap());
    let names: Vec<&str> = by_place.map(|seat| table.at(seat).robot.as_str()).collect();

    assert_eq!(names, ["a", "b", "l", "m", "mm", "q", "z"]);
    for place in 0..7 {
        let seat = table.at_place(usize::from(place)).unwrap();
        assert_eq!(table.place_of(seat), Some(place));
    }
}
