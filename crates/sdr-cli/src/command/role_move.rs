//! `sdr role move`: an operator names the holder.

use std::{
    process::ExitCode,
    time::{Duration, Instant},
};

use sdr_core::{
    api::{RoleAnswer, RoleMoveRequest, RoleView, StatusView},
    id::RobotId,
};
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

/// Arguments of `sdr role move`.
#[derive(Debug, clap::Args)]
pub(crate) struct MoveArgs {
    /// The robot that is to hold the role
    robot: RobotId,
    /// Wait until the asked agent sees it hold the role
    #[arg(long)]
    wait: bool,
    /// How long to wait at most
    #[arg(long, value_name = "TIME", default_value = "60s", value_parser = duration::parse)]
    timeout: Duration,
}

/// What `-o json` prints.
#[derive(Debug, Serialize)]
struct MoveReport<'a> {
    #[serde(flatten)]
    answer: &'a RoleAnswer,
    /// Whether the robot held it in time; null without `--wait`.
    done: Option<bool>,
}

pub(super) async fn run(args: MoveArgs, session: &Session) -> Result<ExitCode, Failure> {
    let client = Client::of(session)?;
    let request = RoleMoveRequest { to: args.robot.clone() };
    let answer: RoleAnswer = client.post("/v1/role/move", &request).await?;
    let done = match args.wait {
        true => Some(wait(&client, &args, &answer, session).await?),
        false => None,
    };
    match session.output.format() {
        Format::Json => session.output.json(&MoveReport { answer: &answer, done })?,
        Format::Text if args.wait => {}
        Format::Text => {
            let word = if answer.changed { "is to hold" } else { "holds" };
            session.output.line(&format!(
                "{} {word} the role, term {}    next: sdr role",
                args.robot, answer.term
            ))?;
        }
    }
    Ok(if done == Some(false) { ExitCode::FAILURE } else { ExitCode::SUCCESS })
}

/// Whether the robot held the role in time, by the view of the asked agent.
async fn wait(
    client: &Client,
    args: &MoveArgs,
    answer: &RoleAnswer,
    session: &Session,
) -> Result<bool, Failure> {
    let mut progress = Progress::new(&session.output);
    let limit = format!("of {} s", args.timeout.as_secs_f64());
    let since = Instant::now();
    loop {
        let late = since.elapsed() >= args.timeout;
        let role = match client.get::<StatusView>("/v1/status").await {
            Ok(view) => view.role,
            Err(error) if late => return Err(error.into()),
            Err(error) => {
                progress.show(&session.output, unanswered(&error), &limit)?;
                tokio::time::sleep(POLL_EVERY).await;
                continue;
            }
        };
        let held = role.holder.as_deref() == Some(args.robot.as_str()) && role.term >= answer.term;
        let head = match held {
            true => format!("{} holds the role, term {}", args.robot, role.term),
            false => format!("waiting for {} to hold the role; {}", args.robot, held_by(&role)),
        };
        progress.show(&session.output, Frame { head, lines: Vec::new() }, &limit)?;
        if held {
            return Ok(true);
        }
        if late {
            let seconds = args.timeout.as_secs_f64();
            let text = format!("sdr: {} does not hold the role after {seconds} s", args.robot);
            session.output.note(&text)?;
            session.output.note(&format!(" {}", held_by(&role)))?;
            return Ok(false);
        }
        tokio::time::sleep(POLL_EVERY).await;
    }
}

fn held_by(role: &RoleView) -> String {
    match &role.holder {
        Some(holder) => format!("{holder} holds it, term {}", role.term),
        None => String::from("nobody is known to hold it"),
    }
}
