//! `sdr status`: the fleet as one agent sees it; exit code 1 when something is wrong.

use std::process::ExitCode;

use sdr_core::api::StatusView;
use serde::Serialize;

use crate::{Session, client::Client, failure::Failure, output::Format, render};

/// Arguments of `sdr status`.
#[derive(Debug, clap::Args)]
pub(crate) struct StatusArgs {}

/// The view of the agent and what is wrong in it.
#[derive(Debug, Serialize)]
struct StatusReport<'a> {
    #[serde(flatten)]
    view: &'a StatusView,
    /// Sentences; empty when all is well.
    problems: Vec<String>,
}

/// Asks once and shows.
pub(crate) async fn run(_args: StatusArgs, session: &Session) -> Result<ExitCode, Failure> {
    let view: StatusView = Client::of(session)?.get("/v1/status").await?;
    let problems = render::status::problems(&view);
    let code = if problems.is_empty() { ExitCode::SUCCESS } else { ExitCode::FAILURE };
    match session.output.format() {
        Format::Text => {
            let (columns, _) = session.output.size();
            for line in render::status::screen(&view, columns) {
                session.output.line(&line)?;
            }
        }
        Format::Json => {
            let problems = problems.into_iter().map(|problem| problem.text).collect();
            session.output.json(&StatusReport { view: &view, problems })?;
        }
    }
    Ok(code)
}
