//! `sdr deploy`: check a system file, hand it to an agent, and wait when told so.

use std::{path::PathBuf, process::ExitCode, time::Duration};

use sdr_core::api::{DeployAnswer, DeployRequest};
use sdr_files::Problems;

use super::{
    await_system,
    describe::{ComponentsView, executables},
    duration, problems,
};
use crate::{Session, client::Client, failure::Failure, render::units::one_line};

/// Arguments of `sdr deploy`.
#[derive(Debug, clap::Args)]
pub(crate) struct DeployArgs {
    /// System file
    file: PathBuf,
    /// Wait until every component is active and every connection heard
    #[arg(long)]
    wait: bool,
    /// How long to wait at most
    #[arg(long, value_name = "TIME", default_value = "60s", value_parser = duration::parse)]
    timeout: Duration,
}

/// Checks the file whole before anything is sent.
pub(crate) async fn run(args: DeployArgs, session: &Session) -> Result<ExitCode, Failure> {
    let mut loaded = match sdr_files::load_system(&args.file) {
        Ok(loaded) => loaded,
        Err(found) => return refuse(&found, session),
    };
    let client = Client::of(session)?;
    let there: ComponentsView = client.get("/v1/components").await?;
    if let Err(found) = sdr_files::link_profiles(&mut loaded, &there.components) {
        for name in executables(&loaded.spec) {
            if let Some(reason) = there.undescribed.get(name) {
                session.output.note(&format!("{name} on that robot: {}", one_line(reason)))?;
            }
        }
        return refuse(&found, session);
    }
    let request = DeployRequest { system: loaded.spec };
    let answer: DeployAnswer = client.post("/v1/deploy", &request).await?;
    match args.wait {
        true => await_system::wait(&client, &answer, args.timeout, session).await,
        false => await_system::accepted(&answer, session),
    }
}

fn refuse(found: &Problems, session: &Session) -> Result<ExitCode, Failure> {
    problems::tell(found, "nothing was deployed", session)?;
    Ok(ExitCode::FAILURE)
}
