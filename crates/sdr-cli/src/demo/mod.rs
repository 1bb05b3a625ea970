//! `sdr demo`: the paper's Section III on one machine.
//!
//! ```text
//!  need (enough memory?) ─▶ fleet (folder, ports, three agents) + stage (the world, the truth)
//!     ─▶ story: deploy ─▶ drive ─▶ fade ─▶ report          watch: looks at all agents, each round
//!                                                           board: what the terminal shows of it
//! ```
//!
//! Whatever way it ends, dropping [`fleet::Fleet`] and [`stage::Stage`] leaves no process, no
//! shared memory and no temporary file behind.

mod board;
mod ending;
mod fleet;
mod need;
mod out;
mod pictures;
mod stage;
mod story;
mod system;
mod watch;

use std::{
    cell::Cell,
    path::{Path, PathBuf},
    process::ExitCode,
};

use clap::Args;
use tokio::signal::unix::{SignalKind, signal};

pub(crate) use self::{
    fleet::{Folder, quoted},
    out::Out,
    story::is_up,
};

use self::pictures::Folder as PictureFolder;
use crate::{Session, failure::Failure};

/// The robots of the demo, in the order of the paper.
pub(crate) const ROBOTS: [&str; 3] = ["robot-1", "robot-2", "robot-3"];

/// Runs three robots, five components and one move on this machine.
#[derive(Clone, Debug, Args)]
pub(crate) struct DemoArgs {
    /// Where the report goes [default: the first free ./sdr-demo-N]
    #[arg(long, value_name = "DIR")]
    out: Option<PathBuf>,
    /// Who holds the coordinator role at the start
    #[arg(long, value_name = "ROBOT", value_parser = ROBOTS)]
    coordinator: Option<String>,
    /// Components touch no 500 MB each
    #[arg(long)]
    no_ballast: bool,
    /// Cameras replay the PNG and JPEG pictures of this folder instead of looking at the world
    #[arg(long, value_name = "DIR")]
    images: Option<PathBuf>,
    /// Leave the fleet up after the report, until Ctrl-C
    #[arg(long)]
    keep: bool,
}

/// What was asked for, checked.
#[derive(Debug)]
struct Plan {
    out: Out,
    coordinator: Option<String>,
    ballast: bool,
    images: Option<PictureFolder>,
    keep: bool,
    /// The fleet was left up as wished: the signal that ends it is no failure.
    up: Cell<bool>,
}

impl DemoArgs {
    fn checked(self) -> Result<Plan, Failure> {
        let images = match self.images {
            None => None,
            Some(folder) => Some(PictureFolder::new(&folder)?),
        };
        let (coordinator, ballast) = (self.coordinator, !self.no_ballast);
        need::check(ballast)?;
        let out = Out::new(self.out, Path::new("."), "sdr-demo")?;
        Ok(Plan { out, coordinator, ballast, images, keep: self.keep, up: Cell::new(false) })
    }
}

/// Carries out `sdr demo`. A signal ends it at any moment, and whatever it made goes with it.
pub(crate) async fn run(args: DemoArgs, session: &Session) -> Result<ExitCode, Failure> {
    let plan = args.checked()?;
    let stopped = stop_signal()?;
    tokio::select! {
        ended = story::play(&plan, session) => ended,
        word = stopped => match plan.up.get() {
            true => Ok(ExitCode::SUCCESS),
            false => Err(Failure::new(format!(
                "the demo was stopped ({word}); nothing is left behind"
            ))),
        },
    }
}

/// Waits for whatever asks us to stop, and says what it was.
pub(crate) fn stop_signal() -> Result<impl Future<Output = &'static str>, Failure> {
    let listen = |kind| {
        signal(kind).map_err(|error| Failure::new(format!("cannot listen to signals: {error}")))
    };
    let mut interrupt = listen(SignalKind::interrupt())?;
    let mut terminate = listen(SignalKind::terminate())?;
    let mut hangup = listen(SignalKind::hangup())?;
    Ok(async move {
        tokio::select! {
            _ = interrupt.recv() => "Ctrl-C",
            _ = terminate.recv() => "SIGTERM",
            _ = hangup.recv() => "the terminal closed",
        }
    })
}
