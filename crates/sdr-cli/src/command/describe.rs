//! Asks component executables what ports and parameters they have (`--describe`).

use std::{collections::BTreeMap, path::Path, process::Stdio, time::Duration};

use rustix::process::{Pid, Signal, kill_process_group};
use sdr_core::spec::{ComponentProfile, SystemSpec};
use serde::Deserialize;
use tokio::{io::AsyncReadExt, process::Command, time::timeout};

use crate::locate;

/// How long an executable may take to describe itself.
const DESCRIBE_WITHIN: Duration = Duration::from_secs(5);
/// Longest description that is read.
const DESCRIPTION_BYTES_MAX: u64 = 1 << 20;

/// `GET /v1/components`: what the agent's own robot can launch.
#[derive(Debug, Deserialize)]
pub(super) struct ComponentsView {
    /// What each executable says of itself.
    pub(super) components: Vec<ComponentProfile>,
    /// Executables that said nothing usable, and why.
    #[serde(default)]
    pub(super) undescribed: BTreeMap<String, String>,
}

/// Profiles of the system's executables in `folder`, and why others have none.
pub(super) async fn profiles(
    system: &SystemSpec,
    folder: &Path,
) -> (Vec<ComponentProfile>, Vec<String>) {
    let (mut found, mut missing) = (Vec::new(), Vec::new());
    for name in executables(system) {
        match describe(&folder.join(name)).await {
            Ok(mut profile) => {
                // It is launched by its file name, whatever it calls itself.
                profile.name = name.into();
                found.push(profile);
            }
            Err(reason) => missing.push(reason),
        }
    }
    (found, missing)
}

/// What the system launches, each once, in the order of the file.
pub(super) fn executables(system: &SystemSpec) -> Vec<&str> {
    let mut names = Vec::new();
    for component in &system.components {
        let name = component.launch.name();
        if !names.contains(&name) {
            names.push(name);
        }
    }
    names
}

async fn describe(program: &Path) -> Result<ComponentProfile, String> {
    let shown = program.display();
    if !locate::is_program(program) {
        return Err(format!("no program {shown}"));
    }
    let answer = timeout(DESCRIBE_WITHIN, output_of(program)).await;
    let text = match answer {
        Ok(Ok(text)) => text,
        Ok(Err(error)) => return Err(format!("{shown} --describe: {error}")),
        Err(_) => {
            let seconds = DESCRIBE_WITHIN.as_secs();
            return Err(format!("{shown} --describe did not end within {seconds} s"));
        }
    };
    serde_json::from_slice(&text)
        .map_err(|error| format!("{shown} --describe printed no component profile: {error}"))
}

/// A program and all it started; killed when it is dropped before the program ended.
struct Group(Option<Pid>);

impl Drop for Group {
    fn drop(&mut self) {
        if let Some(leader) = self.0 {
            // It may have ended this very moment.
            let _ = kill_process_group(leader, Signal::KILL);
        }
    }
}

/// What the program prints; it and all it started end with us.
async fn output_of(program: &Path) -> std::io::Result<Vec<u8>> {
    let mut child = Command::new(program)
        .arg("--describe")
        .stdin(Stdio::null())
        .stdout(Stdio::piped())
        .stderr(Stdio::null())
        .process_group(0)
        .kill_on_drop(true)
        .spawn()?;
    let leader = child.id().and_then(|pid| i32::try_from(pid).ok());
    let mut group = Group(leader.and_then(Pid::from_raw));
    let mut text = Vec::new();
    if let Some(stdout) = child.stdout.take() {
        stdout.take(DESCRIPTION_BYTES_MAX).read_to_end(&mut text).await?;
    }
    let status = child.wait().await?;
    group.0 = None;
    match status.success() {
        true => Ok(text),
        false => Err(std::io::Error::other(format!("it ended with {status}"))),
    }
}
