//! Rows that whole brains fill, as `sdr sim run` runs them.

use std::{ops::Range, time::Duration};

use sdr_lab::sim::{Figures, Plain, Record, Spread};

/// One row of the table.
pub(crate) fn row(what: &str, bar: &str, measured: &str, beside: &str) {
    println!("| {what} | {bar} | {measured} | {beside} |");
}

/// 10 % loss, as many components as robots.
fn plain(robots: usize, time: Duration) -> Plain {
    Plain {
        robots,
        components: robots,
        time,
        loss: 0.1,
        outage: Duration::ZERO,
        stall: Duration::ZERO,
        kills: true,
        converged: false,
        seed: 0,
    }
}

fn run(plain: &Plain, seeds: Range<u64>) -> Figures {
    let mut record = Record::default();
    seeds.for_each(|seed| record.add(Plain { seed, ..plain.clone() }.run()));
    record.figures()
}

pub(crate) fn speed(seed: u64) {
    let time = Duration::from_secs(3600);
    let figures = run(&Plain { kills: false, ..plain(10, time) }, seed..seed + 1);
    let speed = figures.virtual_s / figures.real_s.max(0.001);
    let measured = format!("{speed:.0} times real time");
    row("simulator, 10 robots, one core", "1000", &measured, "");
}

pub(crate) fn airtime(robots: usize, bar: &str, seeds: Range<u64>, time: Duration) {
    let figures = run(&plain(robots, time), seeds);
    let rate = figures.bytes_per_robot_s;
    let sections = &figures.section_bytes_per_robot_s;
    let of = |name: &str| sections.get(name).copied().unwrap_or(0.0);
    let measured = format!(
        "p50 {}, worst {} (pulses {:.0}, reports {:.0}); guard beats of the worst {}",
        number(rate.p50),
        number(rate.max),
        of("pulse"),
        of("author-delta") + of("ask-records"),
        number(figures.guard_bytes_per_robot_s.max),
    );
    let what = format!("sent, {robots} robots idle, 10 % loss, B/s per robot");
    let beside = match robots {
        30 => "SWIM as memberlist has it 132, tuned 296; plain heartbeat table 976",
        _ => "plain heartbeat table 2,656",
    };
    row(&what, bar, &measured, beside);
    let join = number(figures.join_bytes);
    row(&format!("join, {robots} robots, empty disk, B"), "", &join, "");
}

pub(crate) fn detection(seeds: Range<u64>, time: Duration) {
    let figures = run(&plain(30, time), seeds);
    let dead = "Nav2 bond 4 s, BlueChi 6 s, zenoh 10 s, Consul 15 s, SWIM tuned 17 to 18.6 s, \
                Nomad 20 s, dora 30 s, Kubernetes 40 to 50 s";
    row("quiet after a kill, 30 robots, 10 % loss, ms", "p99 3000", &points(figures.quiet_ms), "");
    row("gone after a kill, ms", "p99 12000", &points(figures.detection_ms), dead);
    row(
        "coordinator killed: a new one acts, ms",
        "p99 2000",
        &points(figures.coordinator_gap_ms),
        "the paper: none; Consul, Nomad: a quorum of servers, none without it",
    );
}

pub(crate) fn deaf(seeds: Range<u64>, time: Duration) {
    let beside = "in 20 min: SWIM tuned 1,135 (5 s), plain heartbeat table 0";
    for kills in [true, false] {
        let plain = Plain { outage: Duration::from_secs(8), kills, ..plain(30, time) };
        let figures = run(&plain, seeds.clone());
        let also = if kills { "" } else { ", nobody killed" };
        let what = format!(
            "false deaths, 30 robots, 10 % loss, every fifth deaf 8 s of each minute{also}"
        );
        row(&what, "0", &deaths(&figures), beside);
    }
}

pub(crate) fn stalls(seeds: Range<u64>, time: Duration) {
    let stall = Duration::from_secs(2);
    let plain = Plain { loss: 0.2, stall, ..plain(30, time) };
    let figures = run(&plain, seeds);
    let what = "false deaths, 30 robots, 20 % loss, each stands still 2 s in 5 min";
    let beside = "SWIM as memberlist has it, without stalls: 1,248 in 15 robot-hours";
    row(what, "1 in 1,000 robot-hours", &deaths(&figures), beside);
}

fn deaths(figures: &Figures) -> String {
    format!("{} in {:.0} robot-hours", figures.false_deaths, figures.robot_hours)
}

fn points(spread: Spread) -> String {
    let [p50, p99, max] = [spread.p50, spread.p99, spread.max].map(number);
    format!("p50 {p50}, p99 {p99}, worst {max}")
}

fn number(value: Option<f64>) -> String {
    value.map_or_else(|| "none".into(), |value| format!("{value:.0}"))
}
