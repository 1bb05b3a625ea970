//! `sdr`, the operator's tool: one sentence in, one request to an agent, one answer out.
//!
//! ```text
//!  arguments ─▶ command/x ─▶ client ─ HTTP + JSON ─▶ sdr-agent: Unix socket, or TLS
//!                   │           │
//!                   ▼           ▼ views of sdr_core::api
//!                render ─▶ output ─▶ stdout, stderr
//! ```
//!
//! Files are read and checked here (`sdr-files`), so that a bad file is refused with its line
//! before anything is sent. Exit code 0: done, 1: failed or something is wrong, 2: wrong usage.

mod client;
mod command;
mod demo;
mod failure;
mod lab;
mod locate;
mod output;
mod render;
mod report;

use std::{path::PathBuf, process::ExitCode};

use clap::{Parser, Subcommand};

use crate::{
    command::{
        completions, deploy, events, keys, logs, policy, reset, role, sim, status, stop, undeploy,
        validate,
    },
    failure::Failure,
    output::{Format, Output},
};

/// What every command is given.
pub(crate) struct Session {
    /// `--agent` or `SDR_AGENT`.
    pub(crate) agent: Option<String>,
    /// `--keys` or `SDR_KEYS`: for agents of other machines.
    pub(crate) keys: Option<PathBuf>,
    /// Where answers go, and in which form.
    pub(crate) output: Output,
}

/// Runs components of one system on a team of robots.
#[derive(Debug, Parser)]
#[command(name = "sdr", version, max_term_width = 80)]
struct Cli {
    /// Agent to ask: a Unix socket, or HOST:PORT with --keys
    /// [default: /run/sdr/agent.sock]
    #[arg(long, global = true, env = "SDR_AGENT", value_name = "ADDRESS", hide_env_values = true)]
    agent: Option<String>,
    /// Folder of an operator's keys, for agents of other machines
    /// [default: sdr/keys below ~/.config]
    #[arg(long, global = true, env = "SDR_KEYS", value_name = "DIR", hide_env_values = true)]
    keys: Option<PathBuf>,
    /// Text for people, or JSON alone on stdout
    #[arg(short, long, global = true, value_enum, default_value_t)]
    output: Format,
    #[command(subcommand)]
    command: Command,
}

#[derive(Debug, Subcommand)]
enum Command {
    /// Check a system file and have the fleet run it
    Deploy(deploy::DeployArgs),
    /// Have the fleet end a system
    Undeploy(undeploy::UndeployArgs),
    /// Check files: systems, robot.toml, policies
    Validate(validate::ValidateArgs),
    /// Show robots, systems and what is wrong with them
    Status(status::StatusArgs),
    /// Show what happened and was decided, with reasons
    Events(events::EventsArgs),
    /// Show what a component wrote
    Logs(logs::LogsArgs),
    /// Try a component anew that is held, or stopped by an emergency stop
    Reset(reset::ResetArgs),
    /// Say in words what a recovery policy does
    Policy(policy::PolicyArgs),
    /// End a robot's components, and then its agent
    Stop(stop::StopArgs),
    /// Show, explain and change who coordinates
    Role(role::RoleArgs),
    /// Make, give out and take back the fleet's keys
    Keys(keys::KeysArgs),
    /// Make a report from the agents' recordings
    Report(report::ReportArgs),
    /// Run three robots, five components and one move on this machine
    Demo(demo::DemoArgs),
    /// Run a scenario: real agents on a played radio, and what must come of it
    Lab(lab::LabArgs),
    /// A robot of the lab, seen from inside; `sdr lab` starts it
    #[command(name = sdr_lab::bed::ROLE, hide = true)]
    LabRole {
        /// Which
        role: String,
    },
    /// Run the agents' brains in virtual time, under faults
    Sim(sim::SimArgs),
    /// Print a completion script for a shell
    Completions(completions::CompletionsArgs),
}

fn main() -> ExitCode {
    let cli = Cli::parse();
    if let Command::LabRole { role } = &cli.command {
        // Before there is any thread: namespaces are entered by a process that has only one.
        return sdr_lab::bed::play(role);
    }
    let session = Session { agent: cli.agent, keys: cli.keys, output: Output::new(cli.output) };
    let runtime = tokio::runtime::Builder::new_current_thread().enable_all().build();
    let ended = match runtime {
        Ok(runtime) => runtime.block_on(run(cli.command, &session)),
        Err(error) => Err(Failure::new(format!("cannot start: {error}"))),
    };
    ended.unwrap_or_else(|failure| failure.tell(&session.output))
}

async fn run(command: Command, session: &Session) -> Result<ExitCode, Failure> {
    match command {
        Command::Deploy(args) => deploy::run(args, session).await,
        Command::Undeploy(args) => undeploy::run(args, session).await,
        Command::Validate(args) => validate::run(args, session).await,
        Command::Status(args) => status::run(args, session).await,
        Command::Events(args) => events::run(args, session).await,
        Command::Logs(args) => logs::run(args, session).await,
        Command::Reset(args) => reset::run(args, session).await,
        Command::Policy(args) => policy::run(args, session),
        Command::Stop(args) => stop::run(args, session).await,
        Command::Role(args) => role::run(args, session).await,
        Command::Keys(args) => keys::run(args, session).await,
        Command::Report(args) => report::run(args, session).await,
        Command::Demo(args) => demo::run(args, session).await,
        Command::Lab(args) => lab::run(args, session).await,
        Command::LabRole { role } => Ok(sdr_lab::bed::play(&role)),
        Command::Sim(args) => sim::run(args, session),
        Command::Completions(args) => completions::run::<Cli>(args, session),
    }
}
