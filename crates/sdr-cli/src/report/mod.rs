//! `sdr report`: a report from the agents' recordings.

use std::process::ExitCode;

use crate::{Session, failure::Failure};

/// Arguments of `sdr report`.
#[derive(Debug, clap::Args)]
pub(crate) struct ReportArgs {}

/// Makes the report.
pub(crate) async fn run(_args: ReportArgs, _session: &Session) -> Result<ExitCode, Failure> {
    Err(Failure::new("reports are not built in yet"))
}
