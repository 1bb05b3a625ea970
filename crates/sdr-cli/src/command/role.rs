//! `sdr role`: who coordinates and why, by hand and by policy.

use std::{
    path::{Path, PathBuf},
    process::ExitCode,
};

use clap::Subcommand;
use sdr_core::{
    api::{EventView, RoleAnswer, RolePolicyRequest, RoleView, StatusView},
    fitness::RolePolicy,
};
use serde::Serialize;

use super::{last_words::far_client, problems, role_move};
use crate::{
    Session,
    client::Client,
    failure::Failure,
    output::Format,
    render::role::{self, Taken},
};

/// Arguments of `sdr role`.
#[derive(Debug, clap::Args)]
pub(crate) struct RoleArgs {
    #[command(subcommand)]
    command: Option<RoleCommand>,
}

#[derive(Debug, Subcommand)]
enum RoleCommand {
    /// Show who holds the role, who follows and who could (also without any word)
    Show,
    /// Say why the robots stand in this order
    Why,
    /// Give the role to a robot
    Move(role_move::MoveArgs),
    /// Show the policy in force, or check a file and put it in force
    Policy {
        /// Role policy, such as policies/role/default.yaml
        file: Option<PathBuf>,
    },
}

/// What `-o json` prints of `show` and `why`.
#[derive(Debug, Serialize)]
struct RoleReport<'a> {
    seen_from: &'a str,
    #[serde(flatten)]
    role: &'a RoleView,
    /// When the holder took it and why; null when its agent no longer says so, or not from here.
    taken: Option<&'a Taken>,
}

/// What `-o json` prints of `why`.
#[derive(Debug, Serialize)]
struct WhyReport<'a> {
    #[serde(flatten)]
    report: RoleReport<'a>,
    /// The ranking in sentences.
    why: Vec<String>,
}

/// What `-o json` prints of `policy FILE`.
#[derive(Debug, Serialize)]
struct PolicyReport<'a> {
    policy: &'a RolePolicy,
    /// Null without a file.
    changed: Option<bool>,
}

pub(crate) async fn run(args: RoleArgs, session: &Session) -> Result<ExitCode, Failure> {
    match args.command.unwrap_or(RoleCommand::Show) {
        RoleCommand::Show => show(session).await,
        RoleCommand::Why => why(session).await,
        RoleCommand::Move(args) => role_move::run(args, session).await,
        RoleCommand::Policy { file: None } => policy(session).await,
        RoleCommand::Policy { file: Some(file) } => set_policy(&file, session).await,
    }
}

async fn show(session: &Session) -> Result<ExitCode, Failure> {
    let (view, taken) = ask(session).await?;
    match session.output.format() {
        Format::Json => session.output.json(&report(&view, taken.as_ref()))?,
        Format::Text => {
            let (columns, _) = session.output.size();
            for line in role::screen(&view, taken.as_ref(), columns) {
                session.output.line(&line)?;
            }
        }
    }
    Ok(verdict(&view.role))
}

async fn why(session: &Session) -> Result<ExitCode, Failure> {
    let (view, taken) = ask(session).await?;
    let (columns, _) = session.output.size();
    match session.output.format() {
        Format::Json => {
            let why = role::ranking(&view, usize::MAX);
            let why = why.iter().map(|line| line.trim().to_owned());
            let why = why.filter(|line| !line.is_empty()).collect();
            session.output.json(&WhyReport { report: report(&view, taken.as_ref()), why })?;
        }
        Format::Text => {
            for line in role::ranking(&view, columns) {
                session.output.line(&line)?;
            }
        }
    }
    Ok(verdict(&view.role))
}

fn report<'a>(view: &'a StatusView, taken: Option<&'a Taken>) -> RoleReport<'a> {
    RoleReport { seen_from: &view.seen_from, role: &view.role, taken }
}

/// Nobody decides for the fleet: something is wrong.
fn verdict(role: &RoleView) -> ExitCode {
    match role.holder.is_none() || role.suspended {
        true => ExitCode::FAILURE,
        false => ExitCode::SUCCESS,
    }
}

async fn ask(session: &Session) -> Result<(StatusView, Option<Taken>), Failure> {
    let client = Client::of(session)?;
    let view: StatusView = client.get("/v1/status").await?;
    let taken = taken(&view, &client).await;
    Ok((view, taken))
}

/// When and why the holder took the role, where its agent can be asked from here. What cannot
/// be learnt is left out.
async fn taken(view: &StatusView, client: &Client) -> Option<Taken> {
    let holder = view.role.holder.as_ref()?;
    let asked = match *holder == view.seen_from {
        true => client.clone(),
        false => far_client(holder, view)?,
    };
    let events: Vec<EventView> = asked.hurried().get("/v1/events").await.ok()?;
    Taken::of(&events, &view.role)
}

async fn policy(session: &Session) -> Result<ExitCode, Failure> {
    let view: StatusView = Client::of(session)?.get("/v1/status").await?;
    let policy = &view.role.rules;
    match session.output.format() {
        Format::Json => session.output.json(&PolicyReport { policy, changed: None })?,
        Format::Text => session.output.text(&sdr_files::role_text(policy))?,
    }
    Ok(ExitCode::SUCCESS)
}

async fn set_policy(file: &Path, session: &Session) -> Result<ExitCode, Failure> {
    let policy = match sdr_files::load_role(file) {
        Ok(policy) => policy,
        Err(found) => {
            problems::tell(&found, "nothing was changed", session)?;
            return Ok(ExitCode::FAILURE);
        }
    };
    let request = RolePolicyRequest { policy };
    let answer: RoleAnswer = Client::of(session)?.post("/v1/role/policy", &request).await?;
    let policy = &request.policy;
    match session.output.format() {
        Format::Json => {
            session.output.json(&PolicyReport { policy, changed: Some(answer.changed) })?;
        }
        Format::Text => {
            let word = if answer.changed { "in force" } else { "in force already" };
            session.output.line(&format!("policy {} {word}    next: sdr role why", policy.name))?;
        }
    }
    Ok(ExitCode::SUCCESS)
}
