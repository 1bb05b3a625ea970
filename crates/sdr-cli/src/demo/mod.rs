//! `sdr demo`: three robots, five components and one move on this machine.

use std::process::ExitCode;

use crate::{Session, failure::Failure};

/// Arguments of `sdr demo`.
#[derive(Debug, clap::Args)]
pub(crate) struct DemoArgs {}

/// Runs the demo.
pub(crate) async fn run(_args: DemoArgs, _session: &Session) -> Result<ExitCode, Failure> {
    Err(Failure::new("the demo is not built in yet"))
}
