//! Defects planted in the core on purpose: a checker must catch each one.
//!
//! `cargo test -p sdr-lab --features planted --test planted`: a process and a build of its
//! own, since the chosen defect is one for the whole process and must reach no other build.

use std::sync::atomic::{AtomicU64, Ordering};

use sdr_core::planted::{Defect, plant};
use sdr_lab::sim::{Scenario, Telling};

/// Seeds tried for one defect; those that break a rule without it are left out.
const SEEDS: u64 = 1000;
const THREADS: usize = 2;

/// The first seed of `seeds` that breaks a rule, and the rule.
fn caught(seeds: &[u64]) -> Option<(u64, String)> {
    let next = AtomicU64::new(0);
    let stop = AtomicU64::new(u64::MAX);
    let work = || loop {
        let index = next.fetch_add(1, Ordering::Relaxed);
        let seed = *seeds.get(usize::try_from(index).ok()?)?;
        if index > stop.load(Ordering::Relaxed) {
            return None;
        }
        if let Some(found) = Scenario::draw(seed).run(Telling::Silent).violation() {
            stop.fetch_min(index, Ordering::Relaxed);
            return Some((seed, found.rule.clone()));
        }
    };
    std::thread::scope(|scope| {
        let workers: Vec<_> = (0..THREADS).map(|_| scope.spawn(work)).collect();
        workers
            .into_iter()
            .filter_map(|worker| worker.join().expect("no run panics past its net"))
            .min()
    })
}

#[test]
fn every_planted_defect_is_caught() {
    plant(None);
    let clean: Vec<u64> = (1..=SEEDS)
        .filter(|seed| Scenario::draw(*seed).run(Telling::Silent).violation().is_none())
        .collect();
    let mut missed = Vec::new();
    for defect in Defect::ALL {
        plant(Some(defect));
        match caught(&clean) {
            Some((seed, rule)) => println!("{defect:?}: {rule} in seed {seed}"),
            None => missed.push(defect),
        }
    }
    plant(None);
    assert!(missed.is_empty(), "not caught in {} seeds: {missed:?}", clean.len());
}
