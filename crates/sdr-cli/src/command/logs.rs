//! `sdr logs`: what a component wrote, from the robot where it runs.

use std::{path::Path, process::ExitCode};

use sdr_core::{
    api::{ErrorAnswer, StatusView},
    id::Name,
};

use crate::{
    Session,
    client::{Chunks, Client, ClientError},
    failure::Failure,
    output::Format,
};

/// Arguments of `sdr logs`.
#[derive(Debug, clap::Args)]
pub(crate) struct LogsArgs {
    /// COMPONENT, or SYSTEM/COMPONENT when two systems have one of that name
    #[arg(value_parser = parse)]
    component: Which,
    /// Go on with new lines until Ctrl-C
    #[arg(short, long)]
    follow: bool,
    /// The last N lines first
    #[arg(long, value_name = "N", default_value_t = 100)]
    lines: u32,
}

/// A component by name.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) struct Which {
    pub(super) system: Option<Name>,
    pub(super) component: Name,
}

/// `COMPONENT` or `SYSTEM/COMPONENT`.
pub(super) fn parse(text: &str) -> Result<Which, String> {
    let name = |word: &str| Name::new(word).map_err(|error| error.to_string());
    match text.split_once('/') {
        Some((system, component)) => {
            Ok(Which { system: Some(name(system)?), component: name(component)? })
        }
        None => Ok(Which { system: None, component: name(text)? }),
    }
}

/// Finds the component, then its log.
pub(crate) async fn run(args: LogsArgs, session: &Session) -> Result<ExitCode, Failure> {
    let client = Client::of(session)?;
    let system = match &args.component.system {
        Some(system) => system.to_string(),
        None => system_of(&client.get("/v1/status").await?, &args.component.component)?,
    };
    let path = format!(
        "/v1/logs/{system}/{}?lines={}&follow={}",
        args.component.component, args.lines, args.follow
    );
    let chunks = match client.stream(&path).await {
        Err(ClientError::Refused { answer, .. }) => elsewhere(answer, &path).await?,
        other => other?,
    };
    copy(chunks, session).await
}

/// The one system that has this component.
pub(super) fn system_of(view: &StatusView, component: &Name) -> Result<String, Failure> {
    let has = |name: &str| name == component.as_str();
    let systems: Vec<&str> = (view.systems.iter())
        .filter(|system| system.components.iter().any(|component| has(&component.name)))
        .map(|system| system.name.as_str())
        .collect();
    match systems[..] {
        [system] => Ok(system.into()),
        [] => {
            let known: Vec<&str> = (view.systems.iter())
                .flat_map(|system| system.components.iter().map(|one| one.name.as_str()))
                .collect();
            let known = if known.is_empty() { "none".into() } else { known.join(", ") };
            Err(Failure::new(format!("no component {component} is deployed; there are: {known}")))
        }
        _ => Err(Failure::new(format!(
            "{component} is in {}; say which: sdr logs {}/{component}",
            systems.join(" and "),
            systems.first().unwrap_or(&"SYSTEM")
        ))),
    }
}

/// The log from the home robot's agent, when its socket is on this machine.
async fn elsewhere(answer: ErrorAnswer, path: &str) -> Result<Chunks, Failure> {
    let (Some(home), Some(api)) = (answer.details.get("home"), answer.details.get("api")) else {
        return Err(Failure::Failed(answer));
    };
    let socket = Path::new(api.strip_prefix("unix:").unwrap_or(api));
    if !socket.exists() {
        let text = format!(
            "{}\n  It runs on {home}, whose agent listens at {api}: not on this machine.",
            answer.error
        );
        return Err(Failure::new(text));
    }
    Ok(Client::at(socket).stream(path).await?)
}

/// Bytes for people, one JSON string a line for programs.
async fn copy(mut chunks: Chunks, session: &Session) -> Result<ExitCode, Failure> {
    let mut line = Vec::new();
    while let Some(bytes) = chunks.next().await? {
        match session.output.format() {
            Format::Text => session.output.bytes(&bytes)?,
            Format::Json => {
                for part in bytes.split_inclusive(|byte| *byte == b'\n') {
                    line.extend_from_slice(part);
                    if part.ends_with(b"\n") {
                        say(&mut line, session)?;
                    }
                }
            }
        }
    }
    if !line.is_empty() {
        say(&mut line, session)?;
    }
    Ok(ExitCode::SUCCESS)
}

fn say(line: &mut Vec<u8>, session: &Session) -> Result<(), Failure> {
    let text = String::from_utf8_lossy(line).trim_end_matches(['\n', '\r']).to_owned();
    line.clear();
    session.output.json(&serde_json::json!({ "line": text }))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::render::fixture;

    fn name(word: &str) -> Name {
        Name::new(word).unwrap()
    }

    #[test]
    fn a_component_may_be_named_with_its_system() {
        assert_eq!(parse("a/b"), Ok(Which { system: Some(name("a")), component: name("b") }));
        assert_eq!(parse("b"), Ok(Which { system: None, component: name("b") }));
        assert!(parse("../etc").is_err());
        assert!(parse("a/b/c").is_err());
    }

    #[test]
    fn a_component_is_found_when_one_system_has_it() {
        let mut view = fixture::fleet();
        assert_eq!(system_of(&view, &name("camera")).unwrap(), "exploration");

        let sentence = |result: Result<String, Failure>| format!("{:?}", result.unwrap_err());
        let missing = sentence(system_of(&view, &name("cammera")));
        assert!(missing.contains("there are: fisheye, anomaly, camera"), "{missing}");

        let mut second = fixture::exploration();
        second.name = "other".into();
        view.systems.push(second);
        let doubtful = sentence(system_of(&view, &name("camera")));
        assert!(doubtful.contains("sdr logs exploration/camera"), "{doubtful}");
    }
}
