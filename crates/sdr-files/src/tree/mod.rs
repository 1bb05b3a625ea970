//! A file as a tree of values with their places: the same for TOML and YAML, so that both
//! are read and refused by the same code.

mod from_toml;
mod from_yaml;

pub(crate) use from_toml::parse_toml;
pub(crate) use from_yaml::parse_yaml;

use crate::problem::Mark;

/// Deepest nesting that is read.
pub(crate) const DEPTH_MAX: usize = 32;

/// One value and where it stands.
#[derive(Clone, Debug)]
pub(crate) struct Node {
    pub(crate) mark: Mark,
    pub(crate) body: Body,
}

/// What a value is.
#[derive(Clone, Debug)]
pub(crate) enum Body {
    Nothing,
    Bool(bool),
    Int(i64),
    Float(f64),
    Text(String),
    List(Vec<Node>),
    Table(Vec<(Key, Node)>),
}

/// A key of a table and where it stands.
#[derive(Clone, Debug)]
pub(crate) struct Key {
    pub(crate) mark: Mark,
    pub(crate) word: String,
}

impl Node {
    /// The first key `word` in this value or below it.
    pub(crate) fn find_key(&self, word: &str) -> Option<(&Key, &Self)> {
        match &self.body {
            Body::Table(entries) => entries
                .iter()
                .find(|(key, _)| key.word == word)
                .map(|(key, node)| (key, node))
                .or_else(|| entries.iter().find_map(|(_, node)| node.find_key(word))),
            Body::List(items) => items.iter().find_map(|item| item.find_key(word)),
            Body::Nothing | Body::Bool(_) | Body::Int(_) | Body::Float(_) | Body::Text(_) => None,
        }
    }

    /// What was found, in words.
    pub(crate) fn found(&self) -> String {
        match &self.body {
            Body::Nothing => String::from("nothing"),
            Body::Bool(flag) => format!("`{flag}`"),
            Body::Int(number) => format!("the number {number}"),
            Body::Float(number) => format!("the number {number}"),
            Body::Text(text) => format!("`{}`", shortened(text)),
            Body::List(_) => String::from("a list"),
            Body::Table(_) => String::from("a table of keys"),
        }
    }
}

fn shortened(text: &str) -> String {
    const SHOWN_MAX: usize = 60;
    if text.chars().count() <= SHOWN_MAX {
        return text.escape_debug().to_string();
    }
    let head: String = text.chars().take(SHOWN_MAX).collect();
    format!("{}...", head.escape_debug())
}
