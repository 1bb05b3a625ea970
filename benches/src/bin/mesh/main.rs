//! The bars of the mesh, measured with whole brains in virtual time as `sdr sim run` does, and
//! what others reach beside them.
//!
//! ```text
//! cargo run --release -p sdr-benches --bin mesh            # all rows
//! cargo run --release -p sdr-benches --bin mesh -- airtime detection
//! ```
//!
//! Bytes are all that a robot sends, with 28 bytes for UDP and IP and 32 for the seal, but for
//! guard beats. What others do is quoted: the paper, published defaults, and what was simulated
//! of SWIM.

#![expect(clippy::print_stdout, reason = "its answer goes to standard output")]

mod bars;
mod peers;

use std::time::Duration;

use clap::Parser;

use peers::Peers;

/// Prints the bars of the mesh and what was measured.
#[derive(Parser)]
struct Args {
    /// speed, detection, deaf, stalls, airtime, large, knowing; all when none is named
    parts: Vec<String>,
    /// Runs begin with this seed.
    #[arg(long, default_value_t = 1)]
    seed: u64,
    /// Runs of each row of 30 robots.
    #[arg(long, default_value_t = 3)]
    seeds: u64,
    /// Virtual minutes of each run about detection and airtime, up to 100 robots.
    #[arg(long, default_value_t = 60)]
    minutes: u64,
    /// Virtual hours of each run about false deaths.
    #[arg(long, default_value_t = 1)]
    hours: u64,
    /// Virtual minutes of each run of 300 and 1,000 robots.
    #[arg(long, default_value_t = 2)]
    minutes_large: u64,
}

fn main() {
    let args = Args::parse();
    let wants = |part: &str| args.parts.is_empty() || args.parts.iter().any(|p| p == part);
    let minutes = |count: u64| Duration::from_secs(count * 60);
    let seeds = args.seed..args.seed + args.seeds;
    let one = args.seed..args.seed + 1;
    Peers::head();
    if wants("speed") {
        bars::speed(args.seed);
    }
    if wants("detection") {
        bars::detection(seeds.clone(), minutes(args.minutes));
    }
    if wants("deaf") {
        bars::deaf(seeds.clone(), minutes(60 * args.hours));
    }
    if wants("stalls") {
        bars::stalls(seeds.clone(), minutes(60 * args.hours));
    }
    if wants("airtime") {
        bars::airtime(30, "1000", seeds, minutes(args.minutes.min(20)));
        bars::airtime(100, "1250", one.clone(), minutes(args.minutes.min(10)));
    }
    if wants("large") {
        for robots in [300, 1000] {
            bars::large(robots, one.clone(), minutes(args.minutes_large));
        }
    }
    if wants("knowing") {
        bars::knowing(one, minutes(args.minutes_large));
    }
}
