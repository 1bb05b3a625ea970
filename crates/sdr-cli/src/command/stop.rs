//! `sdr stop`: ends a robot's components, and then its agent.

use std::{
    path::Path,
    process::ExitCode,
    time::{Duration, Instant},
};

use sdr_core::{
    api::{StatusView, StopAnswer},
    id::RobotId,
};
use serde::Serialize;

use super::{await_system::POLL_EVERY, duration};
use crate::{Session, client::Client, failure::Failure, output::Format};

/// Arguments of `sdr stop`.
#[derive(Debug, clap::Args)]
pub(crate) struct StopArgs {
    /// Whose agent [default: the one that is asked]
    robot: Option<RobotId>,
    /// How long to wait for its end
    #[arg(long, value_name = "TIME", default_value = "15s", value_parser = duration::parse)]
    timeout: Duration,
}

/// What `-o json` prints.
#[derive(Debug, Serialize)]
struct StopReport {
    robot: String,
    /// Whether its agent was seen to end.
    done: bool,
}

pub(crate) async fn run(args: StopArgs, session: &Session) -> Result<ExitCode, Failure> {
    let asked = Client::of(session)?;
    let client = match &args.robot {
        Some(robot) => agent_of(robot, asked.get("/v1/status").await?, asked)?,
        None => asked,
    };
    let answer: StopAnswer = client.post("/v1/stop", &()).await?;
    let until = Instant::now() + args.timeout;
    let mut done = false;
    while !done && Instant::now() < until {
        tokio::time::sleep(POLL_EVERY).await;
        done = client.hurried().get::<serde_json::Value>("/v1/health").await.is_err();
    }
    let robot = answer.robot;
    match session.output.format() {
        Format::Json => session.output.json(&StopReport { robot, done })?,
        Format::Text if done => session.output.line(&format!(
            "{robot}: components and agent end; what it decided stays on its disk"
        ))?,
        Format::Text => session.output.line(&format!(
            "{robot}: told to end; its agent still answers after {} s",
            args.timeout.as_secs_f64()
        ))?,
    }
    Ok(if done { ExitCode::SUCCESS } else { ExitCode::FAILURE })
}

/// The agent of a robot: the one asked, or one whose socket is on this machine.
fn agent_of(robot: &RobotId, view: StatusView, asked: Client) -> Result<Client, Failure> {
    if view.seen_from == robot.as_str() {
        return Ok(asked);
    }
    let Some(found) = view.robots.iter().find(|one| one.name == robot.as_str()) else {
        let known: Vec<&str> = view.robots.iter().map(|one| one.name.as_str()).collect();
        let known = known.join(", ");
        return Err(Failure::new(format!("no robot {robot} is known; there are: {known}")));
    };
    let socket = found.api.strip_prefix("unix:").unwrap_or(&found.api);
    if Path::new(socket).exists() {
        return Ok(Client::at(socket));
    }
    Err(Failure::new(format!(
        "the agent of {robot} listens at {socket}: not on this machine\n  \
         Ask it itself: sdr --agent HOST:PORT stop"
    )))
}
