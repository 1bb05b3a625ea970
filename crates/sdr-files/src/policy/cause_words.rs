//! What a rule is about: a cause of Table III, one of the author's, or a program that is asked.

use std::time::Duration;

use schemars::{Schema, SchemaGenerator, json_schema};
use sdr_core::recover::{CAUSE_BYTES_MAX, Cause, Otherwise, Program};
use sdr_recovery::EVERY_MIN;

use crate::{
    near::nearest,
    read::{At, Read, Reader, choices, table},
    tree::{Body, Node},
};

/// Longest answer time of a program when the file gives none.
const LIMIT: Duration = Duration::from_millis(500);
/// Most causes of one program.
const CAUSES_MAX: usize = 16;

table! {
    /// A program that is asked: facts as JSON on its standard input, causes as JSON on its
    /// standard output.
    pub(crate) struct ProgramTable {
        /// Its file in the robot's component path, or a list of that and arguments.
        exec: At<Command>,
        /// Time between two runs.
        every: At<Duration>,
        /// The causes that it may find; default: one, named as its file.
        causes: Option<At<Vec<At<String>>>>,
        /// It is ended when it takes longer; default 500ms.
        limit: Option<At<Duration>>,
        /// What counts when it gives no answer: ignore (default), raise or clear.
        otherwise: Option<At<Otherwise>>,
    }
}

/// The cause called `word`; what is none, or nearly a known one, is told.
pub(crate) fn cause_of(at: &At<String>, reader: &mut Reader) -> Option<Cause> {
    let known: Vec<&str> = Cause::KNOWN.iter().map(Cause::word).collect();
    match Cause::from_word(&at.value) {
        Ok(cause @ Cause::Own(_)) if nearest(&at.value, known.iter().copied()).is_none() => {
            Some(cause)
        }
        Ok(Cause::Own(_)) => {
            reader.unknown(at.mark, "cause", &at.value, &known);
            None
        }
        Ok(cause) => Some(cause),
        Err(error) => {
            let help = format!("allowed: {}, or a name of your own", known.join(", "));
            reader.problem(at.mark, error.to_string(), Some(help));
            None
        }
    }
}

/// What a rule is about.
#[derive(Clone, Debug)]
pub(crate) enum CauseEntry {
    Cause(Cause),
    /// What is asked, and the causes that it may find.
    Program(Program, Vec<At<Cause>>),
}

impl Read for CauseEntry {
    fn read(node: &Node, reader: &mut Reader) -> Option<Self> {
        if matches!(node.body, Body::Table(_)) {
            let table = ProgramTable::read(node, reader)?;
            return program(table, reader);
        }
        let known: Vec<&str> = Cause::KNOWN.iter().map(Cause::word).collect();
        let value = reader.text(node, &known.join(", "))?.to_owned();
        cause_of(&At { value, mark: node.mark }, reader).map(Self::Cause)
    }

    fn schema(generator: &mut SchemaGenerator) -> Schema {
        let known: Vec<&str> = Cause::KNOWN.iter().map(Cause::word).collect();
        let own = json_schema!({
            "type": "string",
            "pattern": "^[a-z][a-z0-9]*(-[a-z0-9]+)*$",
            "maxLength": CAUSE_BYTES_MAX,
        });
        json_schema!({ "anyOf": [{ "enum": known }, own, ProgramTable::schema(generator)] })
    }
}

fn program(table: ProgramTable, reader: &mut Reader) -> Option<CauseEntry> {
    let ProgramTable { exec, every, causes, limit, otherwise } = table;
    if every.value < EVERY_MIN {
        let help = format!("allowed: {EVERY_MIN:?} or more");
        reader.problem(every.mark, format!("every {:?}", every.value), Some(help));
    }
    let limit = match limit {
        Some(limit) if limit.value.is_zero() || limit.value > every.value => {
            let help = format!("allowed: over 0s, at most {:?} (`every`)", every.value);
            reader.problem(limit.mark, format!("a limit of {:?}", limit.value), Some(help));
            return None;
        }
        Some(limit) => limit.value,
        None => LIMIT.min(every.value),
    };
    let causes = match causes {
        Some(list) if list.value.is_empty() || list.value.len() > CAUSES_MAX => {
            let help = format!("allowed: 1 to {CAUSES_MAX}");
            reader.problem(list.mark, format!("{} causes", list.value.len()), Some(help));
            return None;
        }
        Some(list) => list.value,
        None => vec![At { value: stem(&exec.value.0[0]), mark: exec.mark }],
    };
    let own = |at: &At<String>, reader: &mut Reader| {
        let cause = cause_of(at, reader)?;
        if matches!(cause, Cause::Own(_)) {
            return Some(At { value: cause, mark: at.mark });
        }
        let message = format!("{cause} is not found by a program");
        reader.problem(at.mark, message, Some(String::from("allowed: a name of your own")));
        None
    };
    let causes: Vec<At<Cause>> = causes.iter().filter_map(|at| own(at, reader)).collect();
    let otherwise = otherwise.map_or(Otherwise::Ignore, |at| at.value);
    let program = Program { command: exec.value.0, every: every.value, limit, otherwise };
    Some(CauseEntry::Program(program, causes))
}

/// `my_conditions.py` becomes `my-conditions`.
fn stem(file: &str) -> String {
    file.split('.').next().unwrap_or_default().replace('_', "-")
}

/// A file of the component path, and arguments.
#[derive(Clone, Debug)]
pub(crate) struct Command(Vec<String>);

impl Read for Command {
    fn read(node: &Node, reader: &mut Reader) -> Option<Self> {
        const ALLOWED: &str = "a file of the robot's [components] path, such as ./my_conditions.py, or [file, argument]";
        let mut words = match &node.body {
            Body::List(_) => Vec::<String>::read(node, reader)?,
            Body::Nothing
            | Body::Bool(_)
            | Body::Int(_)
            | Body::Float(_)
            | Body::Text(_)
            | Body::Table(_) => vec![reader.text(node, ALLOWED)?.to_owned()],
        };
        let file = words.first().map(|word| word.strip_prefix("./").unwrap_or(word).to_owned());
        match file.filter(|file| !file.is_empty() && !file.contains('/') && !file.starts_with('.'))
        {
            Some(file) => words[0] = file,
            None => {
                reader.wrong(node, ALLOWED);
                return None;
            }
        }
        Some(Self(words))
    }

    fn schema(generator: &mut SchemaGenerator) -> Schema {
        json_schema!({ "anyOf": [String::schema(generator), Vec::<String>::schema(generator)] })
    }
}

choices! {
    Otherwise { "ignore" => Self::Ignore, "raise" => Self::Raise, "clear" => Self::Clear, }
}
