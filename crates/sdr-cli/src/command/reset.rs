//! `sdr reset`: a component that is held or latched is tried anew.

use std::process::ExitCode;

use sdr_core::{
    api::{ResetAnswer, ResetRequest},
    id::Name,
};

use super::logs::{Which, parse, system_of};
use crate::{Session, client::Client, failure::Failure, output::Format};

/// Arguments of `sdr reset`.
#[derive(Debug, clap::Args)]
pub(crate) struct ResetArgs {
    /// COMPONENT, or SYSTEM/COMPONENT when two systems have one of that name
    #[arg(value_parser = parse)]
    component: Which,
}

/// Asks any agent; the component's home hears of it by the mesh.
pub(crate) async fn run(args: ResetArgs, session: &Session) -> Result<ExitCode, Failure> {
    let client = Client::of(session)?;
    let Which { system, component } = args.component;
    let system = match system {
        Some(system) => system,
        None => {
            let word = system_of(&client.get("/v1/status").await?, &component)?;
            Name::new(&word).map_err(|error| Failure::new(error.to_string()))?
        }
    };
    let request = ResetRequest { system, component };
    let answer: ResetAnswer = client.post("/v1/reset", &request).await?;
    match session.output.format() {
        Format::Json => session.output.json(&answer)?,
        Format::Text => {
            let was = answer.was.map(|was| format!(" (was latched by {was})")).unwrap_or_default();
            let line = format!("{} is reset{was}.  next: sdr status", answer.component);
            session.output.line(&line)?;
        }
    }
    Ok(ExitCode::SUCCESS)
}
