//! The fault campaign: one case, many trials, with real agents and real processes.
//!
//! ```text
//! cargo run --release -p sdr-benches --bin failover -- --case agent-kill --trials 200 -o json
//! ```
//!
//! A case is a file in `cases/`. What each figure means stands at [`report::Trial`]; the raw
//! data of every trial is kept.

mod cases;
mod fleet;
mod report;
mod samples;

use std::error::Error;
use std::path::PathBuf;

use clap::{Parser, ValueEnum};
use sdr_benches::line;

use cases::Name;
use fleet::Fleet;
use report::Report;

/// Arguments.
#[derive(Debug, Parser)]
struct Args {
    /// What is broken.
    #[arg(long, value_enum)]
    case: Name,
    /// How often.
    #[arg(long, default_value_t = 200)]
    trials: usize,
    /// Text for people, or JSON alone.
    #[arg(short, long, value_enum, default_value_t = Format::Text)]
    output: Format,
    /// Where the raw data goes.
    #[arg(long, default_value = "target/failover")]
    out: PathBuf,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
enum Format {
    Text,
    Json,
}

fn main() -> Result<(), Box<dyn Error>> {
    let args = Args::parse();
    let mut case = cases::make(args.case);
    let mut fleet = Fleet::start(case.robots())?;
    fleet.deploy(&case.system(&fleet))?;
    let mut report = Report::new(&args.case.to_string(), &args.out)?;
    for number in 1..=args.trials {
        let trial = case.trial(&mut fleet).map_err(|error| {
            let story = fleet.keep(&args.out);
            format!("trial {number}: {error}; logs are in {}", story.display())
        })?;
        report.take(trial)?;
    }
    fleet.stop();
    match args.output {
        Format::Json => line(&serde_json::to_string(&report.summary())?)?,
        Format::Text => report.table()?,
    }
    Ok(())
}
