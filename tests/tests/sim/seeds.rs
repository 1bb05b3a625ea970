//! Drawn runs: hundreds of seeds, and the same seed twice.

use std::{
    sync::atomic::{AtomicU64, Ordering},
    time::Duration,
};

use sdr_lab::sim::{
    DiskFate, Fault, Incident, Plain, Scenario, Telling, Violation, shrink, systems,
};

/// What every change must survive; `sdr sim run --chaos --seeds 10000` runs more.
const SEEDS: u64 = 500;
const THREADS: usize = 2;

fn violations_of(seeds: std::ops::RangeInclusive<u64>) -> Vec<Violation> {
    let next = AtomicU64::new(*seeds.start());
    let work = || {
        let mut found = Vec::new();
        loop {
            let seed = next.fetch_add(1, Ordering::Relaxed);
            if seed > *seeds.end() {
                return found;
            }
            found.extend(Scenario::draw(seed).run(Telling::Silent).record.violations);
        }
    };
    std::thread::scope(|scope| {
        let workers: Vec<_> = (0..THREADS).map(|_| scope.spawn(work)).collect();
        workers.into_iter().flat_map(|worker| worker.join().unwrap()).collect()
    })
}

#[test]
fn no_seed_breaks_a_rule() {
    let found = violations_of(1..=SEEDS);

    let lines: Vec<String> = found
        .iter()
        .map(|v| format!("{}: sdr sim replay --seed {} --shrink ({})", v.rule, v.seed, v.what))
        .collect();
    assert!(found.is_empty(), "{} of {SEEDS} seeds:\n{}", found.len(), lines.join("\n"));
}

/// Seeds that once broke a rule.
const ONCE_BROKEN: [u64; 10] = [236, 651, 1203, 1426, 1555, 1682, 1802, 5107, 7177, 9912];

#[test]
fn no_seed_breaks_a_rule_that_it_once_broke() {
    let broken: Vec<Violation> =
        ONCE_BROKEN.into_iter().flat_map(|seed| violations_of(seed..=seed)).collect();

    assert_eq!(broken, Vec::new());
}

#[test]
fn the_same_seed_leaves_the_same_trace() {
    for seed in 1..=5 {
        let scenario = Scenario::draw(seed);
        let (one, two) = (scenario.run(Telling::Whole), scenario.run(Telling::Whole));
        assert_eq!(one.record.trace_hash, two.record.trace_hash, "seed {seed}");
        assert_eq!(one.story, two.story, "seed {seed}");
        // telling a story changes nothing of it
        assert_eq!(scenario.run(Telling::Silent).record.trace_hash, one.record.trace_hash);
    }
    assert_ne!(
        Scenario::draw(1).run(Telling::Silent).record.trace_hash,
        Scenario::draw(2).run(Telling::Silent).record.trace_hash
    );
}

#[test]
fn a_plain_run_measures_what_it_promises() {
    let plain = Plain {
        robots: 4,
        components: 6,
        time: Duration::from_secs(400),
        loss: 0.1,
        outage: Duration::ZERO,
        stall: Duration::ZERO,
        kills: true,
        seed: 3,
    };

    let (one, two) = (plain.run(), plain.run());

    assert_eq!(one.trace_hash, two.trace_hash);
    assert_eq!(one.violations, Vec::new());
    let figures = one.figures();
    assert_eq!(figures.false_deaths, 0);
    assert!(figures.detection_ms.p50.is_some() && figures.coordinator_gap_ms.p50.is_some());
    assert!(figures.known99_ms.is_some() && figures.join_bytes.is_some());
    assert!(figures.bytes_per_robot_s.p50.is_some_and(|rate| rate > 0.0));
}

#[test]
fn shrinking_keeps_the_rule_and_drops_what_it_does_not_need() {
    // a system pinned to a robot that never comes back cannot run
    let mut scenario = Scenario::draw(3);
    scenario.incidents.retain(|incident| !matches!(incident.fault, Fault::Deploy { .. }));
    let needs = systems::fitting(3, 1, scenario.setup().memory, scenario.setup().cpu);
    let mut system = systems::chain(systems::name("pinned", 1), 1, needs);
    system.components[0].place.robot = Some("robot-2".parse().unwrap());
    let lost = Fault::Crash { robot: 1, down: None, disk: DiskFate::Kept };
    let deployed = Fault::Deploy { robot: 0, system: Box::new(system) };
    for (after, fault) in [(2000, deployed), (400, lost)] {
        let after = Duration::from_millis(after);
        scenario.incidents.insert(0, Incident { after, fault });
    }
    let found = scenario.run(Telling::Silent).violation().unwrap().clone();

    let shrunk = shrink(&scenario, &found.rule);

    assert_eq!((found.rule.as_str(), &shrunk.numbers[..]), ("not-converged", &[1, 2][..]));
    assert!(shrunk.fair);
    assert_eq!(shrunk.scenario.run(Telling::Silent).violation().unwrap().what, found.what);
}
