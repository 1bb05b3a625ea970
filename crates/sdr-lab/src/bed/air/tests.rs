//! What the radio does to frames.

use super::*;
use crate::bed::link::Bursts;

const FRAME: usize = 200;

fn seconds(time: f64) -> Duration {
    Duration::from_secs_f64(time)
}

/// Of so many frames, one each millisecond from `from` on, how many arrive at robot 1.
fn arrived(air: &mut Air, from: f64, count: u32, to: Receiver) -> u32 {
    let mut heard = 0;
    for number in 0..count {
        let now = seconds(from) + Duration::from_millis(u64::from(number));
        let arrivals = air.send(now, 0, to, FRAME);
        heard += u32::from(arrivals.iter().any(|(robot, _)| *robot == 1));
    }
    heard
}

fn change(air: &mut Air, robot: usize, change: &LinkChange) {
    air.change(seconds(0.0), robot, change);
}

#[test]
fn a_good_radio_loses_nothing_keeps_order_and_takes_less_than_2_ms() {
    let mut air = Air::new(3, 1);
    let mut last = Duration::ZERO;
    for number in 0..1000 {
        let now = Duration::from_millis(2 * number);
        let arrivals = air.send(now, 0, Receiver::One(2), FRAME);
        let [(2, at)] = arrivals.as_slice() else { panic!("{arrivals:?}") };
        assert!(*at > last && *at - now < Duration::from_millis(2), "{:?}", *at - now);
        last = *at;
    }
    assert_eq!(air.traffic()[2].received_frames, 1000);
}

#[test]
fn tries_that_fail_cost_one_receiver_time_and_all_receivers_the_frame() {
    let mut air = Air::new(2, 1);
    change(&mut air, 1, &LinkChange { try_loss: Some(0.3), ..LinkChange::default() });

    assert_eq!(arrived(&mut air, 0.0, 1000, Receiver::One(1)), 1000);
    let all = arrived(&mut air, 10.0, 1000, Receiver::All);
    assert!((600..=800).contains(&all), "{all}");
}

#[test]
fn a_stated_loss_takes_frames_of_either_kind() {
    let mut air = Air::new(2, 1);
    change(&mut air, 0, &LinkChange { loss: Some(0.2), ..LinkChange::default() });

    for (from, to) in [(0.0, Receiver::One(1)), (10.0, Receiver::All)] {
        let heard = arrived(&mut air, from, 2000, to);
        assert!((1500..=1700).contains(&heard), "{to:?}: {heard}");
    }
}

#[test]
fn bursts_come_and_go_and_take_their_share() {
    let mut air = Air::new(2, 1);
    let bursts = Bursts { loss: 1.0, every: seconds(0.3), lasting: seconds(0.1) };
    change(&mut air, 1, &LinkChange { bursts: Some(bursts), ..LinkChange::default() });

    let heard: Vec<bool> = (0..20_000)
        .map(|ms| arrived(&mut air, f64::from(ms) / 1000.0, 1, Receiver::One(1)) == 1)
        .collect();

    let share = heard.iter().filter(|heard| **heard).count();
    assert!((13_000..=17_000).contains(&share), "{share}");
    // In pieces, not one by one.
    let turns = heard.windows(2).filter(|pair| pair[0] != pair[1]).count();
    assert!((40..=250).contains(&turns), "{turns}");
}

#[test]
fn delay_and_jitter_are_added_at_both_ends() {
    let mut air = Air::new(2, 1);
    let slow = LinkChange { delay: Some(seconds(0.02)), ..LinkChange::default() };
    change(&mut air, 0, &slow);
    change(&mut air, 1, &slow);

    let arrivals = air.send(seconds(1.0), 0, Receiver::One(1), FRAME);

    let took = arrivals[0].1 - seconds(1.0);
    assert!(took > seconds(0.04) && took < seconds(0.042), "{took:?}");
}

#[test]
fn a_full_queue_drops_and_a_slow_link_fills_it() {
    let mut air = Air::new(2, 1);
    let slow =
        LinkChange { rate: Some(100_000.0), queue_bytes: Some(1000), ..LinkChange::default() };
    change(&mut air, 0, &slow);

    let heard = (0..20).filter(|_| !air.send(seconds(1.0), 0, Receiver::One(1), FRAME).is_empty());

    assert_eq!(heard.count(), 5);
    assert_eq!(air.traffic()[0].queue_dropped_frames, 15);
    assert_eq!(arrived(&mut air, 60.0, 1, Receiver::One(1)), 1);
}

#[test]
fn frames_that_wait_go_in_one_turn_and_a_stream_gets_through() {
    let mut air = Air::new(2, 1);
    let roomy = LinkChange { queue_bytes: Some(1 << 24), ..LinkChange::default() };
    change(&mut air, 0, &roomy);

    let last = (0..1000).filter_map(|_| {
        air.send(seconds(1.0), 0, Receiver::One(1), 1500).first().map(|(_, at)| *at)
    });

    // 1.5 MB over two hops at 65 Mbit/s: 378 ms of payload and 32 turns' worth of the rest.
    let took = last.max().unwrap() - seconds(1.0);
    assert!(took > seconds(0.37) && took < seconds(0.42), "{took:?}");
}

#[test]
fn whoever_is_cut_off_hears_nothing_or_is_not_heard() {
    let mut air = Air::new(2, 1);
    for (deaf, robot, hears) in [
        (Deaf::Both, 1, 0),
        (Deaf::In, 1, 0),
        (Deaf::Out, 1, 1),
        (Deaf::Both, 0, 0),
        (Deaf::Out, 0, 0),
        (Deaf::In, 0, 1),
    ] {
        air.deafen(robot, Some(deaf));
        assert_eq!(arrived(&mut air, 1.0, 1, Receiver::One(1)), hears, "{deaf:?} {robot}");
        air.deafen(robot, None);
    }
}

#[test]
fn a_split_is_between_its_sides_only_and_heals() {
    let mut air = Air::new(4, 1);
    air.split("s", vec![true, true, false, false]);

    let heard: Vec<usize> = air
        .send(seconds(1.0), 0, Receiver::All, FRAME)
        .into_iter()
        .map(|(robot, _)| robot)
        .collect();
    assert_eq!(heard, [1]);

    air.heal("s");
    assert_eq!(air.send(seconds(2.0), 0, Receiver::All, FRAME).len(), 3);
}

#[test]
fn behind_a_corner_or_far_away_there_is_no_link() {
    let mut air = Air::new(2, 1);
    air.place(seconds(0.0), 1, (30.0, 0.0), Duration::ZERO);
    assert_eq!(arrived(&mut air, 1.0, 100, Receiver::One(1)), 100);
    assert!(air.shown_dbm(seconds(1.0), 1).is_some());

    change(&mut air, 1, &LinkChange { corners: Some(20.0), ..LinkChange::default() });

    assert_eq!(arrived(&mut air, 2.0, 100, Receiver::One(1)), 0);
    assert_eq!(air.shown_dbm(seconds(2.0), 1), None);
    change(&mut air, 1, &LinkChange { corners: Some(0.0), ..LinkChange::default() });
    air.place(seconds(3.0), 1, (900.0, 0.0), seconds(10.0));
    assert!(air.level_dbm(seconds(4.0), 1).is_some() && air.level_dbm(seconds(14.0), 1).is_none());
}
