//! `sdr lab`: robots of one machine, a played radio, and a file that says what must come of it.
//!
//! ```text
//!  scenario file ─▶ fleet (namespaces, keys, agents) ─▶ play: act ──▶ bed, agents
//!                                                        judge ◀── eyes (views, events of all)
//!                     recordings, tape ─▶ report.html, report.json, lab.json ─▶ exit code
//! ```
//!
//! Whatever way it ends, dropping [`fleet::Fleet`] leaves no process, no namespace and no folder; what a run that
//! was killed left is removed by the next ([`leftovers`]).

mod act;
mod answer;
mod config;
mod deeds;
mod eyes;
mod finish;
mod fleet;
mod judge;
mod judged;
mod leftovers;
mod play;

pub(crate) use self::{answer::Told, judged::Verdict};

use std::{path::PathBuf, process::ExitCode};

use clap::{Args, Subcommand};

use crate::{
    Session,
    command::problems,
    demo::{Out, stop_signal},
    failure::Failure,
};

/// Arguments of `sdr lab`.
#[derive(Debug, Args)]
pub(crate) struct LabArgs {
    #[command(subcommand)]
    command: LabCommand,
}

#[derive(Debug, Subcommand)]
enum LabCommand {
    /// Play a scenario and judge it; exit code 1 when an expectation is not met
    Run(RunArgs),
}

/// Arguments of `sdr lab run`.
#[derive(Clone, Debug, Args)]
pub(crate) struct RunArgs {
    /// The scenario
    #[arg(value_name = "SCENARIO.yaml")]
    file: PathBuf,
    /// Where the report goes [default: the first free ./sdr-lab-N]
    #[arg(long, value_name = "DIR")]
    out: Option<PathBuf>,
    /// Draws what is left to chance in the radio
    #[arg(long, default_value_t = 1)]
    seed: u64,
}

/// Carries out `sdr lab`. A signal ends it at any moment, and whatever it made goes with it.
pub(crate) async fn run(args: LabArgs, session: &Session) -> Result<ExitCode, Failure> {
    let LabCommand::Run(args) = args.command;
    let scenario = match sdr_files::load_scenario(&args.file) {
        Ok(scenario) => scenario,
        Err(found) => {
            problems::tell(&found, "nothing was started", session)?;
            return Ok(ExitCode::FAILURE);
        }
    };
    let out = Out::new(args.out, std::path::Path::new("."), "sdr-lab")?;
    let stopped = stop_signal()?;
    tokio::select! {
        ended = play::play(&scenario, args.seed, &out, session) => ended,
        word = stopped => Err(Failure::new(format!(
            "the scenario was stopped ({word}); nothing is left behind"
        ))),
    }
}
