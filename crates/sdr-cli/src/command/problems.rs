//! Problems of files, for people and for programs.

use sdr_files::{Problem, Problems};
use serde::Serialize;

use crate::{Session, failure::Failure, output::Format, render::units::count};

/// One problem as `-o json` prints it.
#[derive(Debug, Serialize)]
pub(super) struct ProblemReport {
    file: String,
    /// From 1; 0 when the whole file is meant.
    line: u32,
    /// In characters, from 1.
    column: u32,
    /// How many characters are meant.
    width: u32,
    /// What was found.
    found: String,
    /// What is allowed, when there is a list or a range.
    allowed: Option<String>,
}

impl ProblemReport {
    /// The problem without the line that it quotes.
    pub(super) fn of(problem: &Problem) -> Self {
        Self {
            file: problem.file.clone(),
            line: problem.line,
            column: problem.column,
            width: problem.width,
            found: problem.message.clone(),
            allowed: problem.help.as_deref().map(|help| {
                // The field's name says it already.
                help.strip_prefix("allowed: ").unwrap_or(help).to_owned()
            }),
        }
    }
}

/// What `-o json` prints of a file that is refused.
#[derive(Debug, Serialize)]
struct Refusal {
    error: String,
    problems: Vec<ProblemReport>,
}

/// Says what is wrong with a file that was to be sent; `outcome` is what became of it.
pub(crate) fn tell(problems: &Problems, outcome: &str, session: &Session) -> Result<(), Failure> {
    let problems = problems.as_slice();
    for problem in problems {
        session.output.note(&problem.to_string())?;
    }
    let error = format!("{}; {outcome}", count(problems.len(), "problem"));
    session.output.note(&format!("sdr: {error}"))?;
    match session.output.format() {
        Format::Text => Ok(()),
        Format::Json => {
            let problems = problems.iter().map(ProblemReport::of).collect();
            session.output.json(&Refusal { error, problems })
        }
    }
}
