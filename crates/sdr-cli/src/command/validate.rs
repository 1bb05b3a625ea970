//! `sdr validate`: checks files without deploying anything.

use std::{
    path::{Path, PathBuf},
    process::ExitCode,
};

use clap::ValueEnum;
use sdr_files::Problems;
use serde::Serialize;

use super::{
    describe::{self, ComponentsView},
    problems::ProblemReport,
};
use crate::{
    Session, client::Client, failure::Failure, locate, output::Format, render::units::count,
};

/// What to do about ports that were not checked.
const WHERE_PROFILES_ARE: &str = "\
  name their folder (--components DIR) or an agent (--agent SOCKET), or build the paper's:
    cargo build --release -p sdr-components";

/// Arguments of `sdr validate`.
#[derive(Debug, clap::Args)]
pub(crate) struct ValidateArgs {
    /// Systems, robot.toml, policies
    #[arg(required = true)]
    files: Vec<PathBuf>,
    /// What the files are [default: told from each file's keys]
    #[arg(long, value_enum)]
    kind: Option<Kind>,
    /// Folder of the component executables [default: the agent's, else beside sdr]
    #[arg(long, value_name = "DIR")]
    components: Option<PathBuf>,
}

/// What a file describes.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum, Serialize)]
#[serde(rename_all = "kebab-case")]
enum Kind {
    System,
    Robot,
    Allocation,
    Recovery,
    Role,
    Scenario,
}

impl Kind {
    fn word(self) -> &'static str {
        match self {
            Self::System => "system",
            Self::Robot => "robot",
            Self::Allocation => "allocation policy",
            Self::Recovery => "recovery policy",
            Self::Role => "role policy",
            Self::Scenario => "scenario",
        }
    }
}

/// One file's result, as `-o json` prints it.
#[derive(Debug, Serialize)]
struct FileReport {
    file: String,
    kind: Kind,
    ok: bool,
    problems: Vec<ProblemReport>,
    /// What could not be checked, and why.
    unchecked: Vec<String>,
    #[serde(skip)]
    text: Vec<String>,
}

/// Checks every file, tells all problems; exit code 1 when there is one.
pub(crate) async fn run(args: ValidateArgs, session: &Session) -> Result<ExitCode, Failure> {
    let mut reports = Vec::new();
    for file in &args.files {
        let kind = args.kind.unwrap_or_else(|| kind_of(file));
        let (found, unchecked) = match kind {
            Kind::System => system(file, args.components.as_deref(), session).await?,
            Kind::Robot => (sdr_files::load_robot(file).err(), Vec::new()),
            Kind::Allocation => (sdr_files::load_allocation(file).err(), Vec::new()),
            Kind::Recovery => (sdr_files::load_recovery(file).err(), Vec::new()),
            Kind::Role => (sdr_files::load_role(file).err(), Vec::new()),
            Kind::Scenario => (sdr_files::load_scenario(file).err(), Vec::new()),
        };
        reports.push(report(file, kind, found.as_ref(), unchecked));
    }
    tell(&reports, session)
}

fn report(file: &Path, kind: Kind, found: Option<&Problems>, unchecked: Vec<String>) -> FileReport {
    let problems = found.map(Problems::as_slice).unwrap_or_default();
    FileReport {
        file: file.display().to_string(),
        kind,
        ok: problems.is_empty(),
        problems: problems.iter().map(ProblemReport::of).collect(),
        unchecked,
        text: problems.iter().map(ToString::to_string).collect(),
    }
}

fn tell(reports: &[FileReport], session: &Session) -> Result<ExitCode, Failure> {
    let fine = reports.iter().all(|report| report.ok);
    match session.output.format() {
        Format::Json => session.output.json(&reports)?,
        Format::Text => {
            for report in reports {
                for line in &report.text {
                    session.output.line(line)?;
                }
                let verdict = match report.ok {
                    true => "fine".into(),
                    false => count(report.problems.len(), "problem"),
                };
                session.output.line(&format!(
                    "{}: {}, {verdict}",
                    report.file,
                    report.kind.word()
                ))?;
                for reason in &report.unchecked {
                    session.output.line(&format!("  ports not checked: {reason}"))?;
                }
                if !report.unchecked.is_empty() {
                    session.output.line(&format!("  {WHERE_PROFILES_ARE}"))?;
                }
            }
        }
    }
    Ok(if fine { ExitCode::SUCCESS } else { ExitCode::FAILURE })
}

/// The kind by the file's own words; systems may name both policies, so they go first.
fn kind_of(file: &Path) -> Kind {
    if file.extension().is_some_and(|extension| extension == "toml") {
        return Kind::Robot;
    }
    // A file that cannot be read is told so by whoever loads it.
    let text = std::fs::read_to_string(file).unwrap_or_default();
    let has = |key: &str| {
        text.lines().any(|line| line.strip_prefix(key).is_some_and(|rest| rest.starts_with(':')))
    };
    if has("scenario") || has("timeline") {
        Kind::Scenario
    } else if has("system") || has("components") {
        Kind::System
    } else if has("rules") || has("ladders") || has("recovery") {
        Kind::Recovery
    } else if has("allocation") || has("strategy") {
        Kind::Allocation
    } else if has("role") || has("weights") || has("bars") {
        Kind::Role
    } else {
        Kind::System
    }
}

/// A system and its ports, as far as somebody knows the executables.
async fn system(
    file: &Path,
    components: Option<&Path>,
    session: &Session,
) -> Result<(Option<Problems>, Vec<String>), Failure> {
    let mut loaded = match sdr_files::load_system(file) {
        Ok(loaded) => loaded,
        Err(found) => return Ok((Some(found), Vec::new())),
    };
    let (profiles, missing) = match components {
        Some(folder) => describe::profiles(&loaded.spec, folder).await,
        None if session.agent.is_some() => {
            let there: ComponentsView = Client::of(session)?.get("/v1/components").await?;
            (there.components, Vec::new())
        }
        None => describe::profiles(&loaded.spec, &locate::folder()?).await,
    };
    // Half of the profiles would make problems of ports that are fine.
    if !missing.is_empty() {
        return Ok((None, missing));
    }
    Ok((sdr_files::link_profiles(&mut loaded, &profiles).err(), Vec::new()))
}
