//! Runs the built binary.

use std::process::{Command, Output};

/// What a run of `sdr` left behind.
pub(crate) struct Run {
    pub(crate) code: Option<i32>,
    pub(crate) stdout: String,
    pub(crate) stderr: String,
}

impl Run {
    /// Stdout as one JSON value.
    pub(crate) fn json(&self) -> serde_json::Value {
        serde_json::from_str(&self.stdout)
            .unwrap_or_else(|error| panic!("{error}: {}", self.stdout))
    }
}

/// `sdr` with these arguments, away from the caller's own agent.
pub(crate) fn sdr(arguments: &[&str]) -> Run {
    let output = command(arguments).output().unwrap();
    ended(&output)
}

/// The command without running it.
pub(crate) fn command(arguments: &[&str]) -> Command {
    let mut command = Command::new(env!("CARGO_BIN_EXE_sdr"));
    command.args(arguments).env_remove("SDR_AGENT").env_remove("XDG_RUNTIME_DIR");
    command
}

fn ended(output: &Output) -> Run {
    Run {
        code: output.status.code(),
        stdout: String::from_utf8(output.stdout.clone()).unwrap(),
        stderr: String::from_utf8(output.stderr.clone()).unwrap(),
    }
}
