//! `sdr completions`: a script that completes `sdr` in a shell.

use std::process::ExitCode;

use clap::CommandFactory;
use clap_complete::Shell;

use crate::{Session, failure::Failure};

/// Arguments of `sdr completions`.
#[derive(Debug, clap::Args)]
pub(crate) struct CompletionsArgs {
    /// For which shell
    #[arg(value_enum)]
    shell: Shell,
}

/// Prints the script; with `-o json` it is the one field of an object.
pub(crate) fn run<C: CommandFactory>(
    args: CompletionsArgs,
    session: &Session,
) -> Result<ExitCode, Failure> {
    let mut script = Vec::new();
    clap_complete::generate(args.shell, &mut C::command(), "sdr", &mut script);
    let script = String::from_utf8_lossy(&script).into_owned();
    match session.output.format() {
        crate::output::Format::Text => session.output.text(&script)?,
        crate::output::Format::Json => {
            let shell = args.shell.to_string();
            session.output.json(&serde_json::json!({ "shell": shell, "script": script }))?;
        }
    }
    Ok(ExitCode::SUCCESS)
}
