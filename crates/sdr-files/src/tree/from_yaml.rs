//! YAML to the tree.

use std::fmt;

use serde::{
    Deserialize, Deserializer,
    de::{self, MapAccess, SeqAccess, Visitor},
};
use serde_yaml::{Location, Spanned, options::DuplicateKeyPolicy};

use super::{Body, DEPTH_MAX, Key, Node};
use crate::problem::{Mark, Problem, Source};

/// The tree of a YAML text: one document, duplicate keys refused, aliases bounded.
pub(crate) fn parse_yaml(source: &Source) -> Result<Node, Vec<Problem>> {
    let options = serde_yaml::options! {
        duplicate_keys: DuplicateKeyPolicy::PassThrough,
        with_snippet: false,
        strict_booleans: true,
    };
    let start = Mark { line: 1, column: 1, width: 1 };
    let raw = match serde_yaml::from_str_with_options::<Spanned<Raw>>(source.text(), options) {
        Ok(raw) => raw,
        Err(error) => {
            let mark = error.location().map_or(start, |at| mark_of(source, &at));
            return Err(vec![source.problem(mark, plain_message(&error), None)]);
        }
    };
    if matches!(raw.value, Raw::Nothing) {
        let message = String::from("found nothing, the file is empty");
        return Err(vec![source.problem(start, message, None)]);
    }
    let mut problems = Vec::new();
    let tree = place(source, raw, &mut problems, 0);
    if problems.is_empty() { Ok(tree) } else { Err(problems) }
}

/// A value as the YAML reader gives it.
enum Raw {
    Nothing,
    Bool(bool),
    Int(i64),
    Float(f64),
    Text(String),
    List(Vec<Spanned<Self>>),
    Table(Vec<(Spanned<Self>, Spanned<Self>)>),
}

impl<'de> Deserialize<'de> for Raw {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        deserializer.deserialize_any(RawVisitor)
    }
}

struct RawVisitor;

impl<'de> Visitor<'de> for RawVisitor {
    type Value = Raw;

    fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("a plain value, a list or a table of keys")
    }

    fn visit_unit<E: de::Error>(self) -> Result<Raw, E> {
        Ok(Raw::Nothing)
    }

    fn visit_none<E: de::Error>(self) -> Result<Raw, E> {
        Ok(Raw::Nothing)
    }

    fn visit_some<D: Deserializer<'de>>(self, deserializer: D) -> Result<Raw, D::Error> {
        Raw::deserialize(deserializer)
    }

    fn visit_bool<E: de::Error>(self, flag: bool) -> Result<Raw, E> {
        Ok(Raw::Bool(flag))
    }

    fn visit_i64<E: de::Error>(self, number: i64) -> Result<Raw, E> {
        Ok(Raw::Int(number))
    }

    fn visit_u64<E: de::Error>(self, number: u64) -> Result<Raw, E> {
        i64::try_from(number).map(Raw::Int).map_err(|_| E::custom(format!("{number} is too large")))
    }

    fn visit_f64<E: de::Error>(self, number: f64) -> Result<Raw, E> {
        Ok(Raw::Float(number))
    }

    fn visit_str<E: de::Error>(self, text: &str) -> Result<Raw, E> {
        Ok(Raw::Text(text.to_owned()))
    }

    fn visit_seq<A: SeqAccess<'de>>(self, mut items: A) -> Result<Raw, A::Error> {
        let mut list = Vec::new();
        while let Some(item) = items.next_element()? {
            list.push(item);
        }
        Ok(Raw::List(list))
    }

    fn visit_map<A: MapAccess<'de>>(self, mut entries: A) -> Result<Raw, A::Error> {
        let mut table = Vec::new();
        while let Some(entry) = entries.next_entry()? {
            table.push(entry);
        }
        Ok(Raw::Table(table))
    }
}

fn place(source: &Source, raw: Spanned<Raw>, problems: &mut Vec<Problem>, depth: usize) -> Node {
    let mark = mark_of(source, &raw.referenced);
    if depth > DEPTH_MAX {
        let message = format!("nested more than {DEPTH_MAX} deep");
        problems.push(source.problem(mark, message, None));
        return Node { mark, body: Body::Nothing };
    }
    let body = match raw.value {
        Raw::Nothing => Body::Nothing,
        Raw::Bool(flag) => Body::Bool(flag),
        Raw::Int(number) => Body::Int(number),
        Raw::Float(number) => Body::Float(number),
        Raw::Text(text) => Body::Text(text),
        Raw::List(items) => Body::List(
            items.into_iter().map(|item| place(source, item, problems, depth + 1)).collect(),
        ),
        Raw::Table(entries) => Body::Table(place_entries(source, entries, problems, depth)),
    };
    Node { mark, body }
}

fn place_entries(
    source: &Source,
    raw: Vec<(Spanned<Raw>, Spanned<Raw>)>,
    problems: &mut Vec<Problem>,
    depth: usize,
) -> Vec<(Key, Node)> {
    let mut entries: Vec<(Key, Node)> = Vec::new();
    for (key, value) in raw {
        let mark = mark_of(source, &key.referenced);
        let word = match key.value {
            Raw::Text(word) => word,
            Raw::Bool(flag) => flag.to_string(),
            Raw::Int(number) => number.to_string(),
            Raw::Float(number) => number.to_string(),
            Raw::Nothing | Raw::List(_) | Raw::Table(_) => {
                let message = String::from("a key must be a plain word");
                problems.push(source.problem(mark, message, None));
                continue;
            }
        };
        if let Some((first, _)) = entries.iter().find(|(other, _)| other.word == word) {
            let message = format!("key `{word}` is there twice");
            let help = format!("the first stands in line {}", first.mark.line);
            problems.push(source.problem(mark, message, Some(help)));
            continue;
        }
        let node = place(source, value, problems, depth + 1);
        entries.push((Key { mark, word }, node));
    }
    entries
}

fn mark_of(source: &Source, at: &Location) -> Mark {
    let span = at.span();
    if let (Some(start), Some(length)) = (span.byte_offset(), span.byte_len())
        && let (Ok(start), Ok(length)) = (usize::try_from(start), usize::try_from(length))
    {
        return source.mark(start, start.saturating_add(length));
    }
    let small = |number: u64| u32::try_from(number).unwrap_or(u32::MAX);
    Mark { line: small(at.line()).max(1), column: small(at.column()).max(1), width: 1 }
}

/// The reader's own words without its place, which stands before ours.
fn plain_message(error: &serde_yaml::Error) -> String {
    let text = error.without_snippet().to_string();
    if let Some(which) = text.split("budget breached:").nth(1) {
        let which = which.split('{').next().unwrap_or(which).trim().to_lowercase();
        return format!("too much for one file ({which}); aliases and nesting count each time");
    }
    let lower = text.to_lowercase();
    let ours = [
        ("multiple", "more than one YAML document; allowed: one, without a second `---`"),
        ("recursive reference", "an alias stands within what it names; allowed: none that does"),
        ("recursion limit", "nested too deep"),
    ];
    if let Some((_, words)) = ours.iter().find(|(theirs, _)| lower.contains(theirs)) {
        return String::from(*words);
    }
    let first = text.lines().next().unwrap_or("not YAML").trim();
    let head = first.split(" at line ").next().unwrap_or(first);
    head.trim_end_matches(['.', ',', ' ']).to_owned()
}
