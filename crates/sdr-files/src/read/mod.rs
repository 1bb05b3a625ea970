//! From the tree to typed files: every key known, every problem told.

mod table;
mod values;

use std::net::SocketAddr;

use schemars::{JsonSchema, Schema, SchemaGenerator, json_schema};

pub(crate) use table::{Keys, choices, table};
pub(crate) use values::{At, Map, Need, quantity};

use crate::{
    near::allowed_words,
    problem::{Mark, Problem, Problems, Source},
    tree::{Body, Node},
};

/// A type that a node of a file can be read into.
pub(crate) trait Read: Sized {
    /// The value of `node`, or `None` after telling `reader` every problem.
    fn read(node: &Node, reader: &mut Reader) -> Option<Self>;

    /// The value when its key is missing; `None` for keys that must be there.
    fn absent() -> Option<Self> {
        None
    }

    /// What may stand there, as JSON schema.
    fn schema(generator: &mut SchemaGenerator) -> Schema;
}

/// Collects the problems of one file.
#[derive(Debug)]
pub(crate) struct Reader {
    source: Source,
    problems: Vec<Problem>,
}

impl Reader {
    pub(crate) fn new(source: Source) -> Self {
        Self { source, problems: Vec::new() }
    }

    /// Tells a problem at `mark`.
    pub(crate) fn problem(&mut self, mark: Mark, message: impl Into<String>, help: Option<String>) {
        let problem = self.source.problem(mark, message.into(), help);
        self.problems.push(problem);
    }

    /// Tells that `node` is not what is allowed here.
    pub(crate) fn wrong(&mut self, node: &Node, allowed: &str) {
        let message = match node.body {
            Body::Nothing => String::from("nothing stands here"),
            Body::Bool(_)
            | Body::Int(_)
            | Body::Float(_)
            | Body::Text(_)
            | Body::List(_)
            | Body::Table(_) => format!("found {}", node.found()),
        };
        self.problem(node.mark, message, Some(format!("allowed: {allowed}")));
    }

    /// Tells that `word` is none of `allowed`.
    pub(crate) fn unknown(&mut self, mark: Mark, what: &str, word: &str, allowed: &[&str]) {
        self.problem(mark, format!("unknown {what} `{word}`"), Some(allowed_words(word, allowed)));
    }

    /// Tells that something is designed but not built yet.
    pub(crate) fn later(&mut self, mark: Mark, word: &str, what: &str) {
        let message = format!("`{word}` ({what}) is not in this version");
        self.problem(mark, message, Some(String::from("take it out")));
    }

    /// The place of `width` bytes at byte `at` of `text`, the value that stands at `mark`; where
    /// that spans lines or was escaped, the whole value and words for the place within.
    pub(crate) fn within(
        &self,
        mark: Mark,
        text: &str,
        (at, width): (usize, usize),
    ) -> (Mark, String) {
        let line = self.source.text().lines().nth(mark.line.saturating_sub(1) as usize);
        let line = line.unwrap_or("");
        let start = mark.column.saturating_sub(1) as usize;
        let rest: String = line.chars().skip(start).collect();
        let quote = usize::from(rest.starts_with(['"', '\'']));
        let count = |bytes: usize| text.get(..bytes).map_or(0, |part| part.chars().count());
        let before = count(at);
        let width = count(at + width).saturating_sub(before).max(1);
        if !rest.chars().skip(quote).collect::<String>().starts_with(text) {
            return (mark, format!(" (character {})", before + 1));
        }
        let number = |count: usize| u32::try_from(count).unwrap_or(u32::MAX);
        let column = mark.column.saturating_add(number(quote + before));
        (Mark { column, width: number(width), ..mark }, String::new())
    }

    /// Takes over the problems of another file.
    pub(crate) fn adopt(&mut self, problems: Problems) {
        self.problems.extend(problems);
    }

    /// `value` when no problem was told.
    pub(crate) fn finish<T>(self, value: Option<T>) -> Result<T, Problems> {
        match (value, Problems::new(self.problems)) {
            (Some(value), None) => Ok(value),
            (_, Some(problems)) => Err(problems),
            (None, None) => Err(Problems::of(Vec::new())),
        }
    }

    pub(crate) fn is_clean(&self) -> bool {
        self.problems.is_empty()
    }

    /// Whether something on this line was told: what follows from it needs no words of its own.
    pub(crate) fn has_told(&self, line: u32) -> bool {
        self.problems.iter().any(|problem| problem.line == line)
    }

    /// The text of `node`.
    pub(crate) fn text<'n>(&mut self, node: &'n Node, allowed: &str) -> Option<&'n str> {
        match &node.body {
            Body::Text(text) => Some(text),
            Body::Nothing
            | Body::Bool(_)
            | Body::Int(_)
            | Body::Float(_)
            | Body::List(_)
            | Body::Table(_) => {
                self.wrong(node, allowed);
                None
            }
        }
    }

    /// One word out of `words`, by its index; `later` are words of later versions.
    pub(crate) fn choice(
        &mut self,
        node: &Node,
        words: &[&str],
        later: &[(&str, &str)],
    ) -> Option<usize> {
        let word = self.text(node, &words.join(", "))?;
        if let Some((_, what)) = later.iter().find(|(other, _)| *other == word) {
            self.later(node.mark, word, what);
            return None;
        }
        let index = words.iter().position(|other| *other == word);
        if index.is_none() {
            self.unknown(node.mark, "word", word, words);
        }
        index
    }
}

/// An address with a port; without one, `port_default`.
pub(crate) fn address(text: &str, port_default: u16) -> Option<SocketAddr> {
    match text.parse::<SocketAddr>() {
        Ok(address) => Some(address),
        Err(_) => text.parse().ok().map(|ip| SocketAddr::new(ip, port_default)),
    }
}

/// The schema of a type read by this module, for derived schemas around it.
pub(crate) fn nested<T: JsonSchema>(generator: &mut SchemaGenerator) -> Schema {
    generator.subschema_for::<T>()
}

/// The schema of a table with the one key `word`.
pub(crate) fn one_key<T: Read>(word: &str, generator: &mut SchemaGenerator) -> Schema {
    json_schema!({
        "type": "object",
        "properties": { word: T::schema(generator) },
        "required": [word],
        "additionalProperties": false,
    })
}
