//! The robot's agent: one loop round the brain, and thin drivers.
//!
//! ```text
//!   metrics ─┐                                   ┌─▶ mesh, store, supervisor, data
//!   mesh ────┼─▶ Input ─▶ brain ─▶ Effect ───────┤
//!   api ─────┤   (run)    (sdr-core)  (effects)  └─▶ api, events, recording
//!   outcomes ┘◀─────────────── what came of it ──────┘
//! ```
//!
//! All decisions are made by [`sdr_core::brain::Brain`]; nothing here decides.

mod api;
mod blobs;
mod clock;
mod config;
mod data;
mod effects;
mod events;
mod installed;
mod limits;
mod memory;
mod mesh;
mod metrics;
mod plan;
mod programs;
mod record;
mod run;
mod store;
mod supervisor;
mod taps;
mod trouble;
mod upgrade;
mod world;

use std::error::Error;
use std::io::{self, Write as _};
use std::path::PathBuf;
use std::process::ExitCode;
use std::thread;

use clap::Parser;
use rustix::process::{Resource, Rlimit, Signal, getpid, getrlimit, kill_process, setrlimit};
use sdr_files::RobotConfig;
use sdr_files::robot::{LogFormat, Places};
use tokio::signal::unix::{SignalKind, signal};
use tokio::sync::watch;
use tokio::task::LocalSet;
use tracing_subscriber::filter::ParseError;
use tracing_subscriber::{Layer, filter::Targets, layer::SubscriberExt, util::SubscriberInitExt};

use run::Ending;
use supervisor::Whom;
use world::World;

/// Shared memory and sockets of many components need more than the usual 1024 descriptors.
const DESCRIPTORS: u64 = 65_536;
/// Exit status of a wrong command line or robot.toml.
const USAGE: u8 = 2;

/// Runs one robot's part of a fleet.
#[derive(Debug, Parser)]
#[command(version, about)]
struct Arguments {
    /// The robot's file [default: /etc/sdr/robot.toml, or the user's sdr/robot.toml]
    #[arg(long, value_name = "FILE")]
    config: Option<PathBuf>,
    /// Check the file, say what is wrong with it, and end
    #[arg(long)]
    check: bool,
    /// End when standard input is closed: whoever started this agent is gone then
    #[arg(long)]
    end_with_stdin: bool,
}

fn main() -> ExitCode {
    if std::env::args_os().nth(1).is_some_and(|word| word == limits::EXEC) {
        return limits::exec();
    }
    let arguments = Arguments::parse();
    let file = arguments.config.unwrap_or_else(|| Places::of_this_process().robot_file());
    let robot = match sdr_files::load_robot(&file) {
        Ok(robot) => robot,
        Err(problems) => return fail(&problems.to_string(), USAGE),
    };
    if arguments.check {
        let said = writeln!(io::stdout(), "{}: fine, robot {}", file.display(), robot.name);
        return if said.is_ok() { ExitCode::SUCCESS } else { ExitCode::FAILURE };
    }
    if let Err(error) = start_log(&robot) {
        return fail(&format!("{}: [log] level: {error}", file.display()), USAGE);
    }
    end_with_any_panic();
    raise_descriptors();
    if arguments.end_with_stdin {
        thread::spawn(end_with_stdin);
    }
    let successor = upgrade::Successor::of_this_process();
    match serve(&robot, &successor) {
        Ok(Ending::Upgrade) => fail(&successor.replace_this_process(), 1),
        Ok(Ending::NotYet | Ending::Leave | Ending::All) => ExitCode::SUCCESS,
        Err(error) => fail(&chain(&*error), 1),
    }
}

fn serve(robot: &RobotConfig, successor: &upgrade::Successor) -> Result<Ending, Box<dyn Error>> {
    let runtime = tokio::runtime::Builder::new_current_thread().enable_all().build()?;
    LocalSet::new().block_on(&runtime, async {
        let (teller, ending) = watch::channel(Ending::NotYet);
        end_with_signals(teller.clone())?;
        upgrade::listen(successor.clone(), teller.clone())?;
        let (brain, mut world) = World::start(robot, teller).await?;
        let ending = run::run(brain, &mut world, ending).await;
        world.stop(if ending == Ending::All { Whom::All } else { Whom::NotKept }).await;
        Ok(ending)
    })
}

/// SIGTERM and SIGINT end the agent; the second one ends the process at once.
fn end_with_signals(teller: watch::Sender<Ending>) -> io::Result<()> {
    let mut terminate = signal(SignalKind::terminate())?;
    let mut interrupt = signal(SignalKind::interrupt())?;
    tokio::task::spawn_local(async move {
        for patience in [true, false] {
            tokio::select! {
                _ = terminate.recv() => {}
                _ = interrupt.recv() => {}
            }
            if !patience {
                std::process::exit(1);
            }
            // The loop may have ended by itself.
            let _ = teller.send(Ending::Leave);
        }
    });
    Ok(())
}

/// Waits until nobody can write to standard input any more, then ends the agent as SIGTERM does.
///
/// The kernel closes a starter's end of the pipe however it dies, which its own clearing up
/// cannot promise.
fn end_with_stdin() {
    // What is written means nothing; a broken stdin is a closed one.
    let _ = io::copy(&mut io::stdin().lock(), &mut io::sink());
    tracing::info!(event = "starter-gone", "standard input is closed");
    if let Err(error) = kill_process(getpid(), Signal::TERM) {
        tracing::error!(event = "not-ended", %error);
    }
}

fn start_log(robot: &RobotConfig) -> Result<(), ParseError> {
    let level = std::env::var("RUST_LOG").unwrap_or_else(|_| robot.log.level.clone());
    let filter: Targets = level.parse()?;
    let layer = tracing_subscriber::fmt::layer().with_writer(io::stderr);
    let layer = match robot.log.format {
        LogFormat::Text => layer.with_ansi(rustix::termios::isatty(io::stderr())).boxed(),
        LogFormat::Json => layer.json().boxed(),
    };
    tracing_subscriber::registry().with(layer).with(filter).init();
    Ok(())
}

/// A broken invariant on any thread ends the agent: components go on, and the next agent
/// starts from the disk. Limping on would be worse.
fn end_with_any_panic() {
    let say = std::panic::take_hook();
    std::panic::set_hook(Box::new(move |panic| {
        say(panic);
        std::process::exit(101);
    }));
}

fn raise_descriptors() {
    let Rlimit { current, maximum } = getrlimit(Resource::Nofile);
    let wanted = maximum.map_or(DESCRIPTORS, |maximum| maximum.min(DESCRIPTORS));
    if current.is_some_and(|current| current < wanted) {
        let raised = Rlimit { current: Some(wanted), maximum };
        if let Err(error) = setrlimit(Resource::Nofile, raised) {
            tracing::warn!(event = "descriptors-not-raised", wanted, %error);
        }
    }
}

fn fail(reason: &str, status: u8) -> ExitCode {
    // Nobody reads it when stderr is closed.
    let _ = writeln!(io::stderr(), "sdr-agent: {reason}");
    ExitCode::from(status)
}

/// The error with its causes, those that it does not name itself.
fn chain(error: &dyn Error) -> String {
    let mut text = error.to_string();
    let mut cause = error.source();
    while let Some(error) = cause {
        let said = error.to_string();
        if !text.contains(&said) {
            text = format!("{text}: {said}");
        }
        cause = error.source();
    }
    text
}
