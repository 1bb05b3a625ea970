//! The gossip mesh against its bars: meshes alone in virtual time, over a lossy radio.
//!
//! ```text
//! cargo run --release -p sdr-benches --bin mesh            # all bars, some minutes
//! cargo run --release -p sdr-benches --bin mesh -- airtime detection
//! ```
//!
//! Bytes are all that a robot sends, with 28 bytes for UDP and IP and 30 for the seal.

#![expect(clippy::print_stdout, reason = "its answer goes to standard output")]
#![expect(clippy::cast_precision_loss, reason = "figures for people")]

mod fleet;

use std::time::{Duration, Instant as Wall};

use clap::Parser;
use sdr_core::{
    id::RobotId,
    mesh::{FleetRecord, MeshNews, Standing},
    order::Version,
    record::{FleetValue, RecordKind, RoleRecord},
    time::Instant,
};

use fleet::{Fleet, Trouble, name};

/// Measures the gossip mesh in virtual time.
#[derive(Parser)]
struct Args {
    /// airtime, detection, deaf, stalls, knowing; all when none is named
    parts: Vec<String>,
    /// Everything is drawn from it.
    #[arg(long, default_value_t = 1)]
    seed: u64,
    /// Airtime of fleets of this size only.
    #[arg(long)]
    robots: Option<usize>,
    /// Hours of deaf robots
    #[arg(long, default_value_t = 1)]
    deaf_hours: u64,
    /// Robot-hours of the stalls, in units of 30
    #[arg(long, default_value_t = 34)]
    stall_hours: u64,
}

fn main() {
    let args = Args::parse();
    let wants = |part: &str| args.parts.is_empty() || args.parts.iter().any(|p| p == part);
    println!("| what | bar | measured |\n| --- | --- | --- |");
    if wants("airtime") {
        for (robots, bar) in [(3, ""), (30, "1000"), (100, "1250"), (300, "1250"), (1000, "1250")] {
            if args.robots.is_none_or(|only| only == robots) {
                airtime(robots, bar, args.seed);
            }
        }
    }
    if wants("detection") {
        detection(args.seed);
    }
    if wants("deaf") {
        deaf(args.seed, args.deaf_hours);
    }
    if wants("stalls") {
        stalls(args.seed, args.stall_hours);
    }
    if wants("knowing") {
        knowing(args.seed);
    }
}

fn losing(loss_permille: usize) -> Trouble {
    Trouble { loss_permille, ..Trouble::default() }
}

/// A fleet where everybody knows everybody.
fn settled(robots: usize, trouble: Trouble, seed: u64) -> Fleet {
    let mut fleet = Fleet::new(robots, Trouble { loss_permille: 0, ..Trouble::default() }, seed);
    for _second in 0..600 {
        fleet.run(Duration::from_secs(1));
        let known = |robot: &fleet::Robot| robot.mesh.authors().robots().count() == robots;
        if fleet.robots.iter().all(known) {
            break;
        }
    }
    fleet.trouble = trouble;
    fleet
}

fn airtime(robots: usize, bar: &str, seed: u64) {
    let begin = Wall::now();
    let mut fleet = settled(robots, losing(100), seed);
    let joined = fleet.now;
    let join: u64 = fleet.robots.iter().map(|robot| robot.bytes).max().unwrap_or(0);
    // longer in large fleets, where reports come by more slowly
    fleet.run(Duration::from_secs(if robots > 100 { 160 } else { 60 }));
    let before: Vec<(u64, u64)> = fleet.robots.iter().map(|r| (r.bytes, r.datagrams)).collect();
    let (window, wall) = (Duration::from_secs(60), Wall::now());
    fleet.said.clear();
    fleet.run(window);
    let speed = window.as_secs_f64() / wall.elapsed().as_secs_f64();
    let mut rates: Vec<u64> =
        fleet.robots.iter().zip(&before).map(|(r, b)| (r.bytes - b.0) / 60).collect();
    let sent: u64 = fleet.robots.iter().zip(&before).map(|(r, b)| r.datagrams - b.1).sum();
    rates.sort_unstable();
    let quiet = fleet.said.iter().filter(|said| matches!(said.news, MeshNews::Quiet(_))).count();
    let gone = fleet.said.iter().filter(|said| matches!(said.news, MeshNews::Gone(_))).count();
    let patience = fleet.robots[0].mesh.patience();
    println!(
        "| airtime, {robots} robots idle, 10 % loss, B/s per robot | {bar} | median {}, max {}; \
         {:.2} datagrams/s; quiet {:.2}/s per robot, gone {gone}; patience {:.1} s / {:.1} s; joined in {:.0} s \
         with at most {join} B; {speed:.1} times real time ({:.0} s in all) |",
        rates[robots / 2],
        rates[robots - 1],
        sent as f64 / 60.0 / robots as f64,
        quiet as f64 / 60.0 / robots as f64,
        patience.0.as_secs_f64(),
        patience.1.as_secs_f64(),
        joined.since(Instant::ZERO).as_secs_f64(),
        begin.elapsed().as_secs_f64(),
    );
}

/// Kills one robot after the other; how long each observer takes to judge it.
fn detection(seed: u64) {
    let mut fleet = settled(30, losing(100), seed);
    fleet.run(Duration::from_secs(60));
    let (mut quiet, mut gone) = (Vec::new(), Vec::new());
    for round in 0..90 {
        let victim = (round * 7) % 30;
        fleet.said.clear();
        let died = fleet.now;
        let before: Vec<Standing> =
            fleet.robots.iter().map(|robot| robot.mesh.standing(&name(victim))).collect();
        fleet.kill(victim);
        fleet.run(Duration::from_secs(30));
        for observer in (0..30).filter(|observer| *observer != victim) {
            let last = |is: &dyn Fn(&MeshNews, &RobotId) -> bool| {
                let of = |said: &&fleet::Said| {
                    said.observer == observer && is(&said.news, &name(victim))
                };
                fleet.said.iter().filter(of).map(|said| said.at.since(died)).next_back()
            };
            let at = last(&|news, robot| *news == MeshNews::Quiet(robot.clone()));
            let was_quiet = before[observer] == Standing::Quiet;
            quiet.push(at.unwrap_or(if was_quiet { Duration::ZERO } else { Duration::MAX }));
            let at = last(&|news, robot| *news == MeshNews::Gone(robot.clone()));
            gone.push(at.unwrap_or(Duration::MAX));
        }
        fleet.restart(victim);
        fleet.run(Duration::from_secs(20));
    }
    let patience = fleet.robots[0].mesh.patience();
    println!("| patience | | {patience:?} |");
    println!("| quiet, 30 robots, 10 % loss, s after death | p99 3 | {} |", spread(&mut quiet));
    println!("| gone, 30 robots, 10 % loss, s after death | p99 12 | {} |", spread(&mut gone));
}

fn deaf(seed: u64, deaf_hours: u64) {
    let trouble =
        Trouble { loss_permille: 100, deaf: Duration::from_secs(8), ..Trouble::default() };
    let (deaths, hours, worst) = false_deaths(trouble, seed, deaf_hours);
    println!(
        "| false deaths, 30 robots, 10 % loss, every fifth deaf 8 s a minute | 0 in an hour | \
         {deaths} in {hours} robot-hours; {worst} |"
    );
}

fn stalls(seed: u64, hours: u64) {
    let trouble =
        Trouble { loss_permille: 200, stall: Duration::from_secs(2), ..Trouble::default() };
    let (deaths, hours, worst) = false_deaths(trouble, seed, hours);
    println!(
        "| false deaths, 30 robots, 20 % loss, each stalls 2 s a minute | 1 in 1000 robot-hours | \
         {deaths} in {hours} robot-hours; {worst} |"
    );
}

/// Deaths that nobody died, robot-hours, and the isolations beside them.
fn false_deaths(trouble: Trouble, seed: u64, hours: u64) -> (usize, u64, String) {
    let mut fleet = settled(30, trouble, seed);
    fleet.run(Duration::from_secs(60));
    let (mut deaths, mut isolated, mut quiet) = (0, 0, 0);
    let wall = Wall::now();
    for _ in 0..hours * 60 {
        fleet.said.clear();
        fleet.run(Duration::from_secs(60));
        for said in &fleet.said {
            match &said.news {
                MeshNews::Gone(robot) => {
                    let victim = fleet.number_of(robot);
                    deaths += usize::from(fleet.is_on(victim));
                }
                MeshNews::Isolated => isolated += 1,
                MeshNews::Quiet(_) => quiet += 1,
                MeshNews::Report(_)
                | MeshNews::Record(_)
                | MeshNews::Alive(_)
                | MeshNews::Rejoined
                | MeshNews::DuplicateId(_) => {}
            }
        }
    }
    let seconds = hours as f64 * 3600.0;
    let speed = seconds / wall.elapsed().as_secs_f64();
    let bytes: u64 = fleet.robots.iter().map(|robot| robot.bytes).max().unwrap_or(0);
    let more = format!(
        "isolated {isolated} times, quiet {:.2}/s per robot, at most {:.0} B/s, {speed:.0} times real time",
        f64::from(quiet) / seconds / 30.0,
        bytes as f64 / seconds,
    );
    (deaths, hours * 30, more)
}

/// How fast a shared record reaches 99 % of a thousand robots at 30 % loss.
fn knowing(seed: u64) {
    let robots = 1000;
    let mut fleet = settled(robots, losing(300), seed);
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
    println!("| 99 % of 1000 hold a new record, 30 % loss, s | 2 | {} |", spread(&mut taken));
}

fn spread(values: &mut [Duration]) -> String {
    values.sort_unstable();
    let at = |permille: usize| {
        let index = (values.len() * permille / 1000).min(values.len() - 1);
        values[index].as_secs_f64()
    };
    format!("p50 {:.2}, p99 {:.2}, max {:.2} of {}", at(500), at(990), at(1000), values.len())
}
