//! Waits until a deployed system is up: every component Active, every connection heard.

use std::{
    process::ExitCode,
    time::{Duration, Instant},
};

use sdr_core::api::{DeployAnswer, StatusView};
use serde::Serialize;

use super::{
    awaited::{Awaited, frame, shortfall},
    last_words,
};
use crate::{
    Session,
    client::{Client, ClientError},
    failure::Failure,
    output::Format,
    render::progress::{Frame, Progress},
};

/// Pause between two looks; an agent answers in well under a millisecond.
pub(super) const POLL_EVERY: Duration = Duration::from_millis(100);

/// What a wait shows while the agent does not answer.
pub(super) fn unanswered(error: &ClientError) -> Frame {
    let text = error.to_string();
    let head = format!("{}; asking again", text.lines().next().unwrap_or_default());
    Frame { head, lines: Vec::new() }
}

/// What `sdr deploy -o json` prints.
#[derive(Debug, Serialize)]
struct DeployReport<'a> {
    #[serde(flatten)]
    answer: &'a DeployAnswer,
    /// Whether everything was up in time; null without `--wait`.
    done: Option<bool>,
    /// How long was waited; null without `--wait`.
    waited_ms: Option<u64>,
    /// What was reached and what is awaited; null without `--wait` or while nothing is known.
    progress: Option<Awaited>,
}

/// Waits at most `timeout` and says how it went.
pub(super) async fn wait(
    client: &Client,
    answer: &DeployAnswer,
    timeout: Duration,
    session: &Session,
) -> Result<ExitCode, Failure> {
    let mut progress = Progress::new(&session.output);
    let limit = format!("of {} s", timeout.as_secs_f64());
    let since = Instant::now();
    let awaited = loop {
        let late = since.elapsed() >= timeout;
        match client.get::<StatusView>("/v1/status").await {
            Ok(status) => {
                let view = status.systems.iter().find(|system| system.name == answer.system);
                let mut awaited = Awaited::of(view, answer.revision);
                let frame = frame(&answer.system, view, awaited.as_ref());
                progress.show(&session.output, frame, &limit)?;
                if awaited.as_ref().is_some_and(Awaited::is_done) {
                    break awaited;
                }
                if late {
                    if let Some(awaited) = &mut awaited {
                        last_words::add(awaited, &answer.system, &status, client).await;
                    }
                    break awaited;
                }
            }
            Err(error) if late => return Err(error.into()),
            // An agent that restarts goes on with what it stored.
            Err(error) => progress.show(&session.output, unanswered(&error), &limit)?,
        }
        tokio::time::sleep(POLL_EVERY).await;
    };
    tell(answer, awaited, since.elapsed(), session)
}

/// The end of the wait: up, or what is missing.
fn tell(
    answer: &DeployAnswer,
    awaited: Option<Awaited>,
    waited: Duration,
    session: &Session,
) -> Result<ExitCode, Failure> {
    let done = awaited.as_ref().is_some_and(Awaited::is_done);
    let seconds = waited.as_secs_f64();
    if !done {
        for line in shortfall(&answer.system, awaited.as_ref(), seconds) {
            session.output.note(&line)?;
        }
    }
    match session.output.format() {
        Format::Text if done => {
            session.output.line(&format!("{} is up after {seconds:.1} s", answer.system))?;
        }
        Format::Text => {}
        Format::Json => session.output.json(&DeployReport {
            answer,
            done: Some(done),
            waited_ms: u64::try_from(waited.as_millis()).ok(),
            progress: awaited,
        })?,
    }
    Ok(if done { ExitCode::SUCCESS } else { ExitCode::FAILURE })
}

/// The answer without a wait.
pub(super) fn accepted(answer: &DeployAnswer, session: &Session) -> Result<ExitCode, Failure> {
    match session.output.format() {
        Format::Text => {
            let word = if answer.changed { "accepted" } else { "unchanged" };
            session.output.line(&format!(
                "{} {word}, revision {}    next: sdr status",
                answer.system, answer.revision
            ))?;
        }
        Format::Json => {
            let report = DeployReport { answer, done: None, waited_ms: None, progress: None };
            session.output.json(&report)?;
        }
    }
    Ok(ExitCode::SUCCESS)
}
