//! `sdr sim`: the very brains of the agents in virtual time.

use std::{
    ops::Range,
    panic::resume_unwind,
    process::ExitCode,
    sync::atomic::{AtomicU64, Ordering},
    time::Duration,
};

use clap::Subcommand;
use sdr_lab::sim::{Figures, Plain, Rate, Record, Scenario, Spread, Telling, fair_weather, shrink};

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
    /// Run one drawn seed again and tell what happened; with --shrink, the shortest story
    Replay(ReplayArgs),
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
    /// Start with everybody known to everybody and everything running
    #[arg(long, conflicts_with = "chaos")]
    converged: bool,
    /// The seed draws everything: fleet, radio, faults, operators; only --seed, --seeds and
    /// --jobs count
    #[arg(long)]
    chaos: bool,
    /// Seeds run at the same time
    #[arg(long, default_value_t = 1, value_parser = clap::value_parser!(u16).range(1..=256))]
    jobs: u16,
    /// Draws what is left to chance
    #[arg(long, default_value_t = 1)]
    seed: u64,
    /// Runs this many seeds, from --seed on
    #[arg(long, default_value_t = 1, value_name = "COUNT")]
    seeds: u64,
}

/// Arguments of `sdr sim replay`.
#[derive(Debug, clap::Args)]
struct ReplayArgs {
    /// The seed that drew the run
    #[arg(long)]
    seed: u64,
    /// Only these incidents, by number
    #[arg(long, value_delimiter = ',', value_name = "NUMBERS")]
    only: Option<Vec<usize>>,
    /// A fair radio and perfect clocks instead of the drawn ones
    #[arg(long)]
    fair: bool,
    /// Leave out what the broken rule does not need, and tell the shortest story
    #[arg(long)]
    shrink: bool,
}

/// Runs and prints; exit code 1 when a rule was broken.
pub(crate) fn run(args: SimArgs, session: &Session) -> Result<ExitCode, Failure> {
    match args.command {
        SimCommand::Run(args) => figures(&args, session),
        SimCommand::Replay(args) => replay(&args, session),
    }
}

fn figures(args: &RunArgs, session: &Session) -> Result<ExitCode, Failure> {
    let plain = plain(args)?;
    let seeds = args.seed..args.seed.saturating_add(args.seeds.max(1));
    let mut record = Record::default();
    for one in each(seeds, usize::from(args.jobs), |seed| match args.chaos {
        true => Scenario::draw(seed).run(Telling::Silent).record,
        false => Plain { seed, ..plain.clone() }.run(),
    }) {
        record.add(one);
    }
    let figures = record.figures();
    match session.output.format() {
        Format::Json => session.output.json(&figures)?,
        Format::Text => {
            for line in lines(&figures) {
                session.output.line(&line)?;
            }
            if args.chaos {
                for violation in &figures.violations {
                    let again = format!("sdr sim replay --seed {} --shrink", violation.seed);
                    session.output.line(&format!("to see why: {again}"))?;
                }
            }
        }
    }
    match figures.violations.is_empty() {
        true => Ok(ExitCode::SUCCESS),
        false => Ok(ExitCode::FAILURE),
    }
}

/// Runs `seeds`, `jobs` at a time; results in the order of the seeds.
fn each(seeds: Range<u64>, jobs: usize, run: impl Fn(u64) -> Record + Sync) -> Vec<Record> {
    let next = AtomicU64::new(seeds.start);
    let work = || {
        let mut done = Vec::new();
        loop {
            let seed = next.fetch_add(1, Ordering::Relaxed);
            if seed >= seeds.end {
                return done;
            }
            done.push((seed, run(seed)));
        }
    };
    let mut all: Vec<(u64, Record)> = std::thread::scope(|scope| {
        let workers: Vec<_> = (0..jobs).map(|_| scope.spawn(work)).collect();
        let joined = workers.into_iter().map(|worker| worker.join());
        joined.flat_map(|done| done.unwrap_or_else(|panic| resume_unwind(panic))).collect()
    });
    all.sort_by_key(|(seed, _)| *seed);
    all.into_iter().map(|(_, record)| record).collect()
}

/// The same run again, told line by line.
fn replay(args: &ReplayArgs, session: &Session) -> Result<ExitCode, Failure> {
    let mut scenario = Scenario::draw(args.seed);
    let mut line = format!("sdr sim replay --seed {}", args.seed);
    if let Some(numbers) = &args.only {
        scenario = scenario.only(numbers);
    }
    if args.fair {
        scenario = fair_weather(&scenario);
    }
    let mut outcome = scenario.run(Telling::Whole);
    if let (true, Some(violation)) = (args.shrink, outcome.violation()) {
        let shrunk = shrink(&scenario, &violation.rule);
        let numbers: Vec<String> = shrunk.numbers.iter().map(ToString::to_string).collect();
        line.push_str(&format!(" --only {}", numbers.join(",")));
        if shrunk.fair || args.fair {
            line.push_str(" --fair");
        }
        scenario = shrunk.scenario;
        outcome = scenario.run(Telling::Whole);
    }
    match session.output.format() {
        Format::Json => session.output.json(&outcome.record.figures())?,
        Format::Text => {
            session.output.line(&format!("{} robots, {:?}", scenario.robots, scenario.weather))?;
            for (index, incident) in scenario.incidents.iter().enumerate() {
                let after = incident.after.as_secs_f64();
                session.output.line(&format!("{:3} {after:8.3} {}", index + 1, incident.fault))?;
            }
            for line in &outcome.story {
                session.output.line(line)?;
            }
            for line in lines(&outcome.record.figures()) {
                session.output.line(&line)?;
            }
            if args.shrink && outcome.violation().is_some() {
                session.output.line(&format!("the same again: {line}"))?;
            }
        }
    }
    match outcome.violation() {
        None => Ok(ExitCode::SUCCESS),
        Some(_) => Ok(ExitCode::FAILURE),
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
        converged: args.converged,
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
        format!("false take-overs   {}", figures.false_takeovers),
        format!("all running after  {}", number(figures.converged_ms, "ms")),
        format!("gone after a kill  {}", spread(&figures.detection_ms)),
        format!("quiet after a kill {}", spread(&figures.quiet_ms)),
        format!("known by 99 %      {}", number(figures.known99_ms, "ms")),
        format!("coordinator gap    {}", spread(&figures.coordinator_gap_ms)),
        format!("  since suspect    {}", spread(&figures.takeover_ms)),
        format!("hand-over, nobody  {}", spread(&figures.handover_gap_ms)),
        format!("  both act         {}", spread(&figures.handover_overlap_ms)),
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
