//! `sdr undeploy`: the fleet ends a system.

use std::{
    process::ExitCode,
    time::{Duration, Instant},
};

use sdr_core::{api::StatusView, id::Name};
use serde::Serialize;

use super::{
    await_system::{POLL_EVERY, unanswered},
    duration,
};
use crate::{
    Session,
    client::Client,
    failure::Failure,
    output::Format,
    render::progress::{Frame, Progress},
};

/// Arguments of `sdr undeploy`.
#[derive(Debug, clap::Args)]
pub(crate) struct UndeployArgs {
    /// Name of the system
    system: Name,
    /// Wait until none of its components is left
    #[arg(long)]
    wait: bool,
    /// How long to wait at most
    #[arg(long, value_name = "TIME", default_value = "60s", value_parser = duration::parse)]
    timeout: Duration,
}

/// What `-o json` prints.
#[derive(Debug, Serialize)]
struct UndeployReport {
    system: String,
    /// Null without `--wait`.
    gone: Option<bool>,
}

/// Asks for the end and, when told so, waits for it.
pub(crate) async fn run(args: UndeployArgs, session: &Session) -> Result<ExitCode, Failure> {
    let client = Client::of(session)?;
    let system = args.system.to_string();
    client.delete(&format!("/v1/systems/{system}")).await?;
    let gone = match args.wait {
        true => Some(wait(&client, &args, session).await?),
        false => None,
    };
    match session.output.format() {
        Format::Json => session.output.json(&UndeployReport { system, gone })?,
        Format::Text if args.wait => {}
        Format::Text => session.output.line(&format!(
            "{system} is to end; its components are being stopped.  next: sdr status"
        ))?,
    }
    Ok(if gone == Some(false) { ExitCode::FAILURE } else { ExitCode::SUCCESS })
}

/// Whether the system was gone in time.
async fn wait(client: &Client, args: &UndeployArgs, session: &Session) -> Result<bool, Failure> {
    let mut progress = Progress::new(&session.output);
    let limit = format!("of {} s", args.timeout.as_secs_f64());
    let since = Instant::now();
    loop {
        let late = since.elapsed() >= args.timeout;
        let left = match client.get::<StatusView>("/v1/status").await {
            Ok(view) => left(&view, args.system.as_str()),
            Err(error) if late => return Err(error.into()),
            Err(error) => {
                progress.show(&session.output, unanswered(&error), &limit)?;
                tokio::time::sleep(POLL_EVERY).await;
                continue;
            }
        };
        let gone = left.is_empty();
        let head = match gone {
            true => format!("{}: gone", args.system),
            false => format!("{}: waiting for its components to end", args.system),
        };
        progress.show(&session.output, Frame { head, lines: left.clone() }, &limit)?;
        if gone {
            return Ok(true);
        }
        if late {
            let seconds = args.timeout.as_secs_f64();
            session.output.note(&format!("sdr: {} is not gone after {seconds} s", args.system))?;
            for line in left {
                session.output.note(&format!(" {line}"))?;
            }
            return Ok(false);
        }
        tokio::time::sleep(POLL_EVERY).await;
    }
}

/// The components that the fleet still shows, one line each.
fn left(view: &StatusView, system: &str) -> Vec<String> {
    let Some(system) = view.systems.iter().find(|view| view.name == system) else {
        return Vec::new();
    };
    let mut lines: Vec<String> = vec![format!(" {} is still known", system.name)];
    lines.extend(system.components.iter().filter_map(|component| {
        let home = component.home.as_ref()?;
        let state = component.state.map_or_else(|| "unknown".into(), |state| state.to_string());
        Some(format!(" {}: {state} on {home}", component.name))
    }));
    lines
}
