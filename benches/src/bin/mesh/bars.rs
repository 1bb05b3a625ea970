//! Rows that whole brains fill, as `sdr sim run` runs them.

use std::{ops::Range, time::Duration};

use sdr_lab::sim::{Figures, Plain, Record, Spread};

use crate::peers::Peers;

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

/// The same of fleets that start converged, ten components a robot, nobody killed.
fn plain_large(robots: usize, time: Duration) -> Plain {
    Plain { components: 10 * robots, kills: false, converged: true, ..plain(robots, time) }
}

fn run(plain: &Plain, seeds: Range<u64>) -> Figures {
    let mut record = Record::default();
    seeds.for_each(|seed| record.add(Plain { seed, ..plain.clone() }.run()));
    record.figures()
}

pub(crate) fn speed(seed: u64) {
    let time = Duration::from_secs(3600);
    let figures = run(&Plain { kills: false, ..plain(10, time) }, seed..seed + 1);
    Peers::NONE.row("simulator, 10 robots, one core", "1000 x real time", &times(&figures));
}

pub(crate) fn detection(seeds: Range<u64>, time: Duration) {
    let figures = run(&plain(30, time), seeds);
    let gone = Peers {
        paper: "a hold of 6 s, then 11 s",
        swim: "tuned: 17 s to 18.6 s",
        consul: "15 s",
        nomad: "20 s",
        dora: "30 s",
    };
    let quiet = points(figures.quiet_ms);
    Peers::NONE.row("quiet after a kill, 30 robots, 10 % loss, ms", "p99 3000", &quiet);
    gone.row("gone after a kill, ms", "p99 12000", &points(figures.detection_ms));
    let leader = Peers {
        paper: "its balancer does not move",
        swim: "has no such role",
        consul: "none without a quorum of servers",
        nomad: "none without a quorum of servers",
        dora: "one coordinator, not replaced",
    };
    let gap = points(figures.coordinator_gap_ms);
    leader.row("coordinator killed: a new one acts, ms", "p99 2000", &gap);
    let since = points(figures.takeover_ms);
    leader.row("the same since the old one was suspect, ms", "300", &since);
    let false_takeovers =
        format!("{} in {:.0} robot-hours", figures.false_takeovers, figures.robot_hours);
    leader.row("role taken from a holder that spoke", "none", &false_takeovers);
    let handed = points(figures.handover_gap_ms);
    leader.row("planned hand-over: nobody acts, ms", "0", &handed);
    let both = points(figures.handover_overlap_ms);
    leader.row("planned hand-over: both ends act, ms", "", &both);
    false_deaths("false deaths meanwhile", "0", &figures, Peers::NONE);
}

pub(crate) fn deaf(seeds: Range<u64>, time: Duration) {
    let swim = "tuned: 1,135 in 20 min with 5 s, 1,978 with a buddy rule and 8 s";
    for kills in [true, false] {
        let plain = Plain { outage: Duration::from_secs(8), kills, ..plain(30, time) };
        let figures = run(&plain, seeds.clone());
        let also = if kills { "" } else { ", nobody killed" };
        let what = format!(
            "false deaths, 30 robots, 10 % loss, every fifth deaf 8 s of each minute{also}"
        );
        false_deaths(&what, "0", &figures, Peers { swim, ..Peers::NONE });
    }
}

pub(crate) fn stalls(seeds: Range<u64>, time: Duration) {
    let stall = Duration::from_secs(2);
    let plain = Plain { loss: 0.2, stall, ..plain(30, time) };
    let figures = run(&plain, seeds);
    let what = "false deaths, 30 robots, 20 % loss, each stands still 2 s in 5 min";
    let swim = "defaults, without stalls: 1,248 in 15 robot-hours";
    false_deaths(what, "1 in 1,000 robot-hours", &figures, Peers { swim, ..Peers::NONE });
}

pub(crate) fn airtime(robots: usize, bar: &str, seeds: Range<u64>, time: Duration) {
    let figures = run(&plain(robots, time), seeds);
    let swim = match robots {
        30 => "defaults 132 at 5 % loss, 625 at 20 %; tuned 296 at 20 %",
        _ => "",
    };
    sent(robots, bar, &figures, Peers { swim, ..Peers::NONE });
    let join = number(figures.join_bytes);
    Peers::NONE.row(&format!("join, {robots} robots, empty disk, B"), "", &join);
}

/// Fleets in which not everybody is told in each datagram.
pub(crate) fn large(robots: usize, seeds: Range<u64>, time: Duration) {
    let figures = run(&plain_large(robots, time), seeds);
    let components = 10 * robots;
    let swim = match robots {
        300 => "tuned 638 at 20 % loss",
        _ => "tuned 1,216 at 20 % loss",
    };
    sent(robots, "1250, flat", &figures, Peers { swim, ..Peers::NONE });
    let what = format!("simulator, {robots} robots, {components} components, one core");
    let bar = if robots == 1000 { "1 x real time" } else { "" };
    Peers::NONE.row(&what, bar, &times(&figures));
    false_deaths(&format!("false deaths, {robots} robots"), "0", &figures, Peers::NONE);
}

pub(crate) fn knowing(seeds: Range<u64>, time: Duration) {
    let figures = run(&Plain { loss: 0.3, ..plain_large(1000, time) }, seeds);
    let what = "99 % of 1,000 robots hold a new record, 30 % loss, the slowest, ms";
    Peers::NONE.row(what, "2000", &number(figures.known99_ms));
}

fn sent(robots: usize, bar: &str, figures: &Figures, peers: Peers) {
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
    peers.row(&format!("sent, {robots} robots idle, 10 % loss, B/s"), bar, &measured);
}

fn false_deaths(what: &str, bar: &str, figures: &Figures, peers: Peers) {
    let deaths = format!("{} in {:.0} robot-hours", figures.false_deaths, figures.robot_hours);
    let broken = match figures.violations.first() {
        Some(violation) => format!("; broken: {} ({})", violation.rule, violation.what),
        None => String::new(),
    };
    peers.row(what, bar, &(deaths + &broken));
}

fn times(figures: &Figures) -> String {
    format!("{:.1} x real time", figures.virtual_s / figures.real_s.max(0.001))
}

fn points(spread: Spread) -> String {
    let [p50, p99, max] = [spread.p50, spread.p99, spread.max].map(number);
    format!("p50 {p50}, p99 {p99}, worst {max}")
}

fn number(value: Option<f64>) -> String {
    value.map_or_else(|| "none".into(), |value| format!("{value:.0}"))
}
