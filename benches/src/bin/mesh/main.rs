//! The bars of the mesh: whole brains in virtual time, as `sdr sim run` measures them, and for
//! a thousand robots meshes alone.
//!
//! ```text
//! cargo run --release -p sdr-benches --bin mesh            # all rows, some minutes
//! cargo run --release -p sdr-benches --bin mesh -- airtime detection
//! ```
//!
//! Bytes are all that a robot sends, with 28 bytes for UDP and IP and 32 for the seal. What
//! others do stands beside: published defaults, or what was simulated of them.

#![expect(clippy::print_stdout, reason = "its answer goes to standard output")]

mod bars;
mod fleet;

use std::time::Duration;

use clap::Parser;
use sdr_core::{
    mesh::FleetRecord,
    order::Version,
    record::{FleetValue, RecordKind, RoleRecord},
};

use bars::row;
use fleet::{Fleet, name};

/// Prints the bars of the mesh and what was measured.
#[derive(Parser)]
struct Args {
    /// speed, airtime, thousand, detection, deaf, stalls, knowing; all when none is named
    parts: Vec<String>,
    /// Runs begin with this seed.
    #[arg(long, default_value_t = 1)]
    seed: u64,
    /// Runs of each row.
    #[arg(long, default_value_t = 3)]
    seeds: u64,
    /// Virtual minutes of each run about airtime and detection.
    #[arg(long, default_value_t = 20)]
    minutes: u64,
    /// Virtual hours of each run about false deaths.
    #[arg(long, default_value_t = 1)]
    hours: u64,
}

fn main() {
    let args = Args::parse();
    let wants = |part: &str| args.parts.is_empty() || args.parts.iter().any(|p| p == part);
    println!("| what | bar | measured | beside |\n| --- | --- | --- | --- |");
    let seeds = args.seed..args.seed + args.seeds;
    let minutes = Duration::from_secs(args.minutes * 60);
    if wants("speed") {
        bars::speed(args.seed);
    }
    if wants("airtime") {
        bars::airtime(30, "1000", seeds.clone(), minutes);
        bars::airtime(100, "1250", args.seed..args.seed + 1, minutes);
    }
    if wants("thousand") {
        for robots in [300, 1000] {
            airtime_alone(robots, args.seed);
        }
    }
    if wants("detection") {
        bars::detection(seeds.clone(), minutes);
    }
    let hours = Duration::from_secs(args.hours * 3600);
    if wants("deaf") {
        bars::deaf(seeds.clone(), hours);
    }
    if wants("stalls") {
        bars::stalls(seeds, hours);
    }
    if wants("knowing") {
        knowing(args.seed);
    }
}

/// A fleet where everybody knows everybody.
fn settled(robots: usize, loss_permille: usize, seed: u64) -> Fleet {
    let mut fleet = Fleet::new(robots, seed);
    for _second in 0..600 {
        fleet.run(Duration::from_secs(1));
        let known = |robot: &fleet::Robot| robot.mesh.authors().robots().count() == robots;
        if fleet.robots.iter().all(known) {
            break;
        }
    }
    fleet.loss_permille = loss_permille;
    fleet
}

/// Meshes alone, each with new host figures every second.
fn airtime_alone(robots: usize, seed: u64) {
    let mut fleet = settled(robots, 100, seed);
    // reports come by more slowly in large fleets
    fleet.run(Duration::from_secs(160));
    let before: Vec<u64> = fleet.robots.iter().map(|robot| robot.bytes).collect();
    fleet.run(Duration::from_secs(60));
    let sent = fleet.robots.iter().zip(&before).map(|(robot, before)| robot.bytes - before);
    let mut rates: Vec<u64> = sent.map(|bytes| bytes / 60).collect();
    rates.sort_unstable();
    let patience = fleet.robots[0].mesh.patience();
    let measured = format!(
        "p50 {}, worst {}; quiet after {:.1} s, gone after {:.1} s",
        rates[robots / 2],
        rates[robots - 1],
        patience.0.as_secs_f64(),
        patience.1.as_secs_f64(),
    );
    let what = format!("sent, {robots} robots idle, 10 % loss, meshes alone, B/s per robot");
    let beside = "SWIM tuned 1,216 at 1,000; plain heartbeat table 6,900";
    row(&what, "1250, flat", &measured, beside);
}

/// How fast a shared record reaches 99 % of a thousand robots at 30 % loss.
fn knowing(seed: u64) {
    let robots = 1000;
    let mut fleet = settled(robots, 300, seed);
    fleet.run(Duration::from_secs(20));
    let mut taken = Vec::new();
    for term in 1..=10 {
        let holder = name(usize::try_from(term).expect("small") * 97);
        let value = FleetValue::Role(RoleRecord {
            holder: holder.clone(),
            term,
            fitness: 1,
            by_operator: false,
        });
        let version = Version { epoch: None, revision: 0, term, author: holder.clone() };
        let record = FleetRecord::new(RecordKind::ROLE, String::new(), version, &value);
        let begin = fleet.now;
        let author = fleet.number_of(&holder);
        fleet.publish(author, record);
        fleet.run_until(begin + Duration::from_secs(30), |fleet| {
            let holds = |robot: &&fleet::Robot| {
                let held = robot.mesh.fleet().get(RecordKind::ROLE, "");
                held.is_some_and(|(version, _)| version.term == term)
            };
            fleet.robots.iter().filter(holds).count() * 100 >= robots * 99
        });
        taken.push(fleet.now.since(begin));
        fleet.run(Duration::from_secs(5));
    }
    row(
        "99 % of 1,000 meshes hold a new record, 30 % loss, s",
        "2",
        &spread(&mut taken),
        "nobody publishes it",
    );
}

fn spread(values: &mut [Duration]) -> String {
    values.sort_unstable();
    let at = |permille: usize| {
        let index = (values.len() * permille / 1000).min(values.len() - 1);
        values[index].as_secs_f64()
    };
    format!("p50 {:.2}, p99 {:.2}, max {:.2} of {}", at(500), at(990), at(1000), values.len())
}
