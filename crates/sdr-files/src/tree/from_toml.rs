//! TOML to the tree.

use toml::{
    Spanned,
    de::{DeTable, DeValue},
};

use super::{Body, DEPTH_MAX, Key, Node};
use crate::problem::{Mark, Problem, Source};

/// The tree of a TOML text; problems of syntax and duplicate keys, all of them.
pub(crate) fn parse_toml(source: &Source) -> Result<Node, Vec<Problem>> {
    let (table, errors) = DeTable::parse_recoverable(source.text());
    let mut problems: Vec<Problem> = errors
        .iter()
        .map(|error| {
            let span = error.span().unwrap_or(0..0);
            let message = error.message().trim().replace('\n', ", ");
            source.problem(source.mark(span.start, span.end), message, None)
        })
        .collect();
    let tree = convert_table(source, table.get_ref(), Mark::FILE, &mut problems, 0);
    if problems.is_empty() { Ok(tree) } else { Err(problems) }
}

fn convert_table(
    source: &Source,
    table: &DeTable<'_>,
    mark: Mark,
    problems: &mut Vec<Problem>,
    depth: usize,
) -> Node {
    let mut entries: Vec<(usize, Key, Node)> = table
        .iter()
        .map(|(key, value)| {
            let span = key.span();
            let key_mark = source.mark(span.start, span.end);
            let word = key.get_ref().to_string();
            let node = convert(source, value, problems, depth + 1);
            (span.start, Key { mark: key_mark, word }, node)
        })
        .collect();
    entries.sort_by_key(|(start, _, _)| *start);
    let entries = entries.into_iter().map(|(_, key, node)| (key, node)).collect();
    Node { mark, body: Body::Table(entries) }
}

fn convert(
    source: &Source,
    value: &Spanned<DeValue<'_>>,
    problems: &mut Vec<Problem>,
    depth: usize,
) -> Node {
    let span = value.span();
    let mark = source.mark(span.start, span.end);
    let mut refuse = |message: String, help: &str| {
        problems.push(source.problem(mark, message, Some(help.to_owned())));
        Body::Nothing
    };
    if depth > DEPTH_MAX {
        let body = refuse(format!("nested more than {DEPTH_MAX} deep"), "allowed: less");
        return Node { mark, body };
    }
    let body = match value.get_ref() {
        DeValue::String(text) => Body::Text(text.to_string()),
        DeValue::Boolean(flag) => Body::Bool(*flag),
        DeValue::Integer(number) => {
            match i64::from_str_radix(&number.as_str().replace('_', ""), number.radix()) {
                Ok(number) => Body::Int(number),
                Err(_) => refuse(format!("`{number}` is too large"), "allowed: 64 bits"),
            }
        }
        DeValue::Float(number) => match number.as_str().replace('_', "").parse::<f64>() {
            Ok(number) if number.is_finite() => Body::Float(number),
            Ok(_) | Err(_) => refuse(format!("`{number}` is no number"), "allowed: finite numbers"),
        },
        DeValue::Datetime(date) => {
            refuse(format!("found the date {date}"), "no key of this file takes a date")
        }
        DeValue::Array(items) => Body::List(
            items.iter().map(|item| convert(source, item, problems, depth + 1)).collect(),
        ),
        DeValue::Table(table) => return convert_table(source, table, mark, problems, depth),
    };
    Node { mark, body }
}
