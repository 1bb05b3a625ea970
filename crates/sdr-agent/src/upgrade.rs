//! An upgrade in place: SIGHUP has this process become what its file holds by then.
//!
//! The process keeps its number, so whoever watches it sees no end, and components stay its
//! children. The successor finds them as after any death of an agent.

use std::env;
use std::ffi::OsString;
use std::io;
use std::os::unix::process::CommandExt as _;
use std::path::PathBuf;
use std::process::{Command, Stdio};

use tokio::signal::unix::{SignalKind, signal};
use tokio::sync::watch;

use crate::run::Ending;

/// The program that follows this one.
#[derive(Clone, Debug)]
pub(crate) struct Successor {
    /// As it was named when this process started; the file may be another by now.
    program: Option<PathBuf>,
    arguments: Vec<OsString>,
}

impl Successor {
    pub(crate) fn of_this_process() -> Self {
        Self { program: env::current_exe().ok(), arguments: env::args_os().skip(1).collect() }
    }

    /// Whether it starts at all and takes the configuration; the error is for the operator.
    async fn check(&self) -> Result<(), String> {
        let Some(program) = &self.program else { return Err("its file is not known".into()) };
        let mut command = tokio::process::Command::new(program);
        command.args(&self.arguments).arg("--check").stdin(Stdio::null());
        let output = command.output().await;
        let output = output.map_err(|error| format!("{}: {error}", program.display()))?;
        match output.status.success() {
            true => Ok(()),
            false => Err(String::from_utf8_lossy(&output.stderr).trim().to_string()),
        }
    }

    /// Becomes it; returns only when that fails.
    pub(crate) fn replace_this_process(&self) -> String {
        let program = self.program.clone().unwrap_or_default();
        let error: io::Error = Command::new(&program).args(&self.arguments).exec();
        format!("upgrade: {}: {error}", program.display())
    }
}

/// SIGHUP ends the agent for its successor, when that is fit.
pub(crate) fn listen(successor: Successor, teller: watch::Sender<Ending>) -> io::Result<()> {
    let mut hangup = signal(SignalKind::hangup())?;
    tokio::task::spawn_local(async move {
        while hangup.recv().await.is_some() {
            match successor.check().await {
                // The loop may have ended by itself.
                Ok(()) => drop(teller.send(Ending::Upgrade)),
                Err(reason) => {
                    tracing::error!(event = "upgrade-refused", reason, next = "go on as it is");
                }
            }
        }
    });
    Ok(())
}
