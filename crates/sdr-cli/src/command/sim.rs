//! `sdr sim`: the very brains of the agents in virtual time.

use std::{process::ExitCode, time::Duration};

use clap::Subcommand;
use sdr_lab::sim::{Figures, Plain, Rate, Record, Spread};

use crate::{Session, failure::Failure, output::Format};

/// Arguments of `sdr sim`.
#[derive(Debug, clap::Args)]
pub(crate) struct SimArgs {
    #[command(subcommand)]
    command: SimCommand,
}

#[derive(Debug, Subcommand)]
enum SimCommand {
    /// Run fleets in virtual time and print what was measured
    Run(RunArgs),
}

/// Arguments of `sdr sim run`.
#[derive(Debug, clap::Args)]
struct RunArgs {
    /// Robots
    #[arg(long, default_value_t = 10, value_parser = clap::value_parser!(u16).range(1..=2000))]
    robots: u16,
    /// Components, in systems of ten
    #[arg(long, default_value_t = 20, value_parser = clap::value_parser!(u16).range(0..=20000))]
    components: u16,
    /// Virtual time of each run, minutes
    #[arg(long, default_value_t = 10.0)]
    minutes: f64,
    /// Datagrams lost, percent
    #[arg(long, default_value_t = 0.0, value_name = "PERCENT")]
    loss: f64,
    /// Every fifth robot is deaf so long in each minute
    #[arg(long, default_value_t = 0.0, value_name = "SECONDS")]
    outage: f64,
    /// Each agent's loop stands still so long once in 5 minutes
    #[arg(long, default_value_t = 0.0, value_name = "SECONDS")]
    stall: f64,
    /// Kill no robots: detection, gaps and joins are not measured
    #[arg(long)]
    no_kills: bool,
    /// Draws what is left to chance
    #[arg(long, default_value_t = 1)]
    seed: u64,
    /// Runs this many seeds, from --seed on
    #[arg(long, default_value_t = 1, value_name = "COUNT")]
    seeds: u64,
}

/// Runs and prints; exit code 1 when a rule was broken.
pub(crate) fn run(args: SimArgs, session: &Session) -> Result<ExitCode, Failure> {
    match args.command {
        SimCommand::Run(args) => figures(&args, session),
    }
}

fn figures(args: &RunArgs, session: &Session) -> Result<ExitCode, Failure> {
    let plain = plain(args)?;
    let mut record = Record::default();
    for seed in args.seed..args.seed.saturating_add(args.seeds.max(1)) {
        record.add(Plain { seed, ..plain.clone() }.run());
    }
    let figures = record.figures();
    match session.output.format() {
        Format::Json => session.output.json(&figures)?,
        Format::Text => {
            for line in lines(&figures) {
                session.output.line(&line)?;
            }
        }
    }
    match figures.violations.is_empty() {
        true => Ok(ExitCode::SUCCESS),
        false => Ok(ExitCode::FAILURE),
    }
}

fn plain(args: &RunArgs) -> Result<Plain, Failure> {
    let within = |word: &str, value: f64, most: f64| match (0.0..=most).contains(&value) {
        true => Ok(value),
        false => Err(Failure::new(format!("--{word} {value}: allowed is 0 to {most}"))),
    };
    let time =
        |word: &str, value: f64, most: f64| within(word, value, most).map(Duration::from_secs_f64);
    Ok(Plain {
        robots: usize::from(args.robots),
        components: usize::from(args.components),
        time: Duration::from_secs_f64(within("minutes", args.minutes, 100_000.0)? * 60.0),
        loss: within("loss", args.loss, 90.0)? / 100.0,
        outage: time("outage", args.outage, 60.0)?,
        stall: time("stall", args.stall, 300.0)?,
        kills: !args.no_kills,
        seed: args.seed,
    })
}

/// The figures for people.
fn lines(figures: &Figures) -> Vec<String> {
    let mut lines = vec![
        format!(
            "{:.0} s of {:.2} robot-hours in {:.2} s: {:.0} times real time",
            figures.virtual_s,
            figures.robot_hours,
            figures.real_s,
            figures.virtual_s / figures.real_s.max(0.001)
        ),
        format!("false deaths       {}", figures.false_deaths),
        format!("all running after  {}", number(figures.converged_ms, "ms")),
        format!("gone after a kill  {}", spread(&figures.detection_ms)),
        format!("quiet after a kill {}", spread(&figures.quiet_ms)),
        format!("known by 99 %      {}", number(figures.known99_ms, "ms")),
        format!("coordinator gap    {}", spread(&figures.coordinator_gap_ms)),
        format!("sent while idle    {}", rate(&figures.bytes_per_robot_s)),
        format!("  guard beats      {}", rate(&figures.guard_bytes_per_robot_s)),
        format!("join, empty disk   {}", number(figures.join_bytes, "B")),
        format!(
            "plans              {}, moves {}, of these needless {}",
            figures.replans, figures.moves, figures.needless_moves
        ),
        format!("trace              {}", figures.trace_hash),
    ];
    for violation in &figures.violations {
        lines.push(format!(
            "BROKEN {} in seed {} at {:.1} s (step {}): {}",
            violation.rule,
            violation.seed,
            violation.at_ms as f64 / 1000.0,
            violation.step,
            violation.what
        ));
    }
    lines
}

fn number(value: Option<f64>, unit: &str) -> String {
    value.map_or_else(|| "-".into(), |value| format!("{value:.0} {unit}"))
}

fn spread(spread: &Spread) -> String {
    match spread.p50 {
        None => "-".into(),
        Some(_) => format!(
            "p50 {}, p99 {}, max {}",
            number(spread.p50, "ms"),
            number(spread.p99, "ms"),
            number(spread.max, "ms")
        ),
    }
}

fn rate(rate: &Rate) -> String {
    format!("p50 {}, max {}", number(rate.p50, "B/s"), number(rate.max, "B/s"))
}
