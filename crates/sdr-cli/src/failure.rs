//! Why a command did not do what was asked: a sentence, what helps, an exit code.

use std::{collections::BTreeMap, io, process::ExitCode};

use sdr_core::api::ErrorAnswer;

use crate::output::{Format, Output};

/// The end of a command that did not succeed.
#[derive(Debug)]
pub(crate) enum Failure {
    /// Tried and failed: exit code 1.
    Failed(ErrorAnswer),
    /// The arguments make no sense together: exit code 2.
    Usage(String),
    /// The reader of our output went away; nobody is left to be told.
    Closed,
}

impl Failure {
    /// Failed for this reason; lines after the first say what helps.
    pub(crate) fn new(reason: impl Into<String>) -> Self {
        Self::Failed(ErrorAnswer { error: reason.into(), details: BTreeMap::new() })
    }

    /// Says the reason where people and scripts look for it and gives the exit code.
    pub(crate) fn tell(self, output: &Output) -> ExitCode {
        let (answer, code) = match self {
            Self::Failed(answer) => (answer, ExitCode::FAILURE),
            Self::Usage(error) => {
                (ErrorAnswer { error, details: BTreeMap::new() }, ExitCode::from(2))
            }
            Self::Closed => return ExitCode::SUCCESS,
        };
        // Nothing is left to do when even this cannot be written.
        let _ = output.note(&format!("sdr: {}", answer.error));
        for (name, value) in &answer.details {
            let _ = output.note(&format!("  {name}: {value}"));
        }
        if output.format() == Format::Json {
            let _ = output.json(&answer);
        }
        code
    }
}

impl From<io::Error> for Failure {
    fn from(error: io::Error) -> Self {
        match error.kind() == io::ErrorKind::BrokenPipe {
            true => Self::Closed,
            false => Self::new(error.to_string()),
        }
    }
}
