//! `sdr status`: the fleet as one agent sees it; exit code 1 when something is wrong.

use std::process::ExitCode;

use sdr_core::api::StatusView;
use serde::Serialize;

use super::last_words;
use crate::{
    Session,
    client::Client,
    failure::Failure,
    output::Format,
    render::{self, problems::Problem},
};

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
    let client = Client::of(session)?;
    let view: StatusView = client.get("/v1/status").await?;
    let mut problems = render::problems::problems(&view);
    for problem in &mut problems {
        let Some(placed) = &problem.component else { continue };
        let last = last_words::of(placed, &view, &client).await;
        problem.details.extend(last.map(|last| format!("last: {last}")));
    }
    let code = if problems.is_empty() { ExitCode::SUCCESS } else { ExitCode::FAILURE };
    match session.output.format() {
        Format::Text => {
            let (columns, _) = session.output.size();
            for line in render::status::screen(&view, &problems, columns) {
                session.output.line(&line)?;
            }
        }
        Format::Json => {
            let problems = problems.into_iter().map(Problem::sentence).collect();
            session.output.json(&StatusReport { view: &view, problems })?;
        }
    }
    Ok(code)
}
