//! What an expression says of given facts.

use core::cmp::Ordering;

use super::{
    names::{Kind, Named},
    parse::{Id, Node, Operator, Part},
};

/// A value while it is worked out.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum Answer<'a> {
    Bool(bool),
    Int(i64),
    Double(f64),
    Text(&'a str),
}

type Facts<'f, 'a> = &'f dyn Fn(Named) -> Option<Answer<'a>>;

/// What a checked expression says; `None` when a fact that matters is unknown, or a number
/// cannot be worked out.
pub(super) fn holds<'a>(nodes: &'a [Node], facts: Facts<'_, 'a>) -> Option<bool> {
    truth(nodes.len().checked_sub(1)?, nodes, facts)
}

/// Only as deep as the parser allows.
fn value<'a>(id: Id, nodes: &'a [Node], facts: Facts<'_, 'a>) -> Option<Answer<'a>> {
    let of = |id: &Id| value(*id, nodes, facts);
    Some(match &nodes[id].part {
        Part::Bool(flag) => Answer::Bool(*flag),
        Part::Int(number) => Answer::Int(*number),
        Part::Double(number) => Answer::Double(*number),
        Part::Text(text) => Answer::Text(text),
        Part::Fact(named) => facts(*named)?,
        Part::Has(named) => Answer::Bool(facts(*named).is_some()),
        Part::Not(inner) => Answer::Bool(!truth(*inner, nodes, facts)?),
        Part::Minus(inner) => match of(inner)? {
            Answer::Int(number) => Answer::Int(number.checked_neg()?),
            Answer::Double(number) => Answer::Double(-number),
            Answer::Bool(_) | Answer::Text(_) => return None,
        },
        Part::Convert(kind, inner) => convert(*kind, of(inner)?)?,
        Part::Choose(test, first, second) => {
            of(if truth(*test, nodes, facts)? { first } else { second })?
        }
        // Lists stand behind `in` only.
        Part::List(_) => return None,
        Part::Two(Operator::And, left, right) => {
            Answer::Bool(both(*left, *right, false, nodes, facts)?)
        }
        Part::Two(Operator::Or, left, right) => {
            Answer::Bool(both(*left, *right, true, nodes, facts)?)
        }
        Part::Two(Operator::In, left, right) => {
            let wanted = of(left)?;
            let Part::List(items) = &nodes[*right].part else { return None };
            Answer::Bool(items.iter().filter_map(of).any(|item| item == wanted))
        }
        Part::Two(operator, left, right) => two(*operator, of(left)?, of(right)?)?,
    })
}

fn truth<'a>(id: Id, nodes: &'a [Node], facts: Facts<'_, 'a>) -> Option<bool> {
    match value(id, nodes, facts)? {
        Answer::Bool(flag) => Some(flag),
        Answer::Int(_) | Answer::Double(_) | Answer::Text(_) => None,
    }
}

/// `&&` and `||`: what one side says alone does not need the other, as in CEL.
fn both<'a>(
    left: Id,
    right: Id,
    decides: bool,
    nodes: &'a [Node],
    facts: Facts<'_, 'a>,
) -> Option<bool> {
    match truth(left, nodes, facts) {
        Some(flag) if flag == decides => Some(decides),
        found => match truth(right, nodes, facts) {
            Some(flag) if flag == decides => Some(decides),
            Some(flag) => found.map(|_| flag),
            None => None,
        },
    }
}

fn two<'a>(operator: Operator, left: Answer<'a>, right: Answer<'a>) -> Option<Answer<'a>> {
    let order = order(left, right);
    let flag = match operator {
        Operator::Equal => order == Some(Ordering::Equal),
        Operator::Unequal => order != Some(Ordering::Equal),
        Operator::Less => order? == Ordering::Less,
        Operator::AtMost => order? != Ordering::Greater,
        Operator::Greater => order? == Ordering::Greater,
        Operator::AtLeast => order? != Ordering::Less,
        Operator::Plus
        | Operator::Minus
        | Operator::Times
        | Operator::Divided
        | Operator::Modulo => return number(operator, left, right),
        Operator::Or | Operator::And | Operator::In => return None,
    };
    Some(Answer::Bool(flag))
}

#[expect(clippy::cast_precision_loss, reason = "counts of a minute, compared with bars")]
fn order(left: Answer<'_>, right: Answer<'_>) -> Option<Ordering> {
    match (left, right) {
        (Answer::Bool(a), Answer::Bool(b)) => Some(a.cmp(&b)),
        (Answer::Int(a), Answer::Int(b)) => Some(a.cmp(&b)),
        (Answer::Text(a), Answer::Text(b)) => Some(a.cmp(b)),
        (Answer::Double(a), Answer::Double(b)) => a.partial_cmp(&b),
        (Answer::Int(a), Answer::Double(b)) => (a as f64).partial_cmp(&b),
        (Answer::Double(a), Answer::Int(b)) => a.partial_cmp(&(b as f64)),
        (Answer::Bool(_) | Answer::Int(_) | Answer::Double(_) | Answer::Text(_), _) => None,
    }
}

fn number<'a>(operator: Operator, left: Answer<'a>, right: Answer<'a>) -> Option<Answer<'a>> {
    match (left, right) {
        (Answer::Int(a), Answer::Int(b)) => Some(Answer::Int(match operator {
            Operator::Plus => a.checked_add(b)?,
            Operator::Minus => a.checked_sub(b)?,
            Operator::Times => a.checked_mul(b)?,
            Operator::Divided => a.checked_div(b)?,
            Operator::Modulo => a.checked_rem(b)?,
            Operator::Or
            | Operator::And
            | Operator::Equal
            | Operator::Unequal
            | Operator::Less
            | Operator::AtMost
            | Operator::Greater
            | Operator::AtLeast
            | Operator::In => return None,
        })),
        (Answer::Double(a), Answer::Double(b)) => Some(Answer::Double(match operator {
            Operator::Plus => a + b,
            Operator::Minus => a - b,
            Operator::Times => a * b,
            Operator::Divided => a / b,
            Operator::Modulo
            | Operator::Or
            | Operator::And
            | Operator::Equal
            | Operator::Unequal
            | Operator::Less
            | Operator::AtMost
            | Operator::Greater
            | Operator::AtLeast
            | Operator::In => return None,
        })),
        (Answer::Bool(_) | Answer::Int(_) | Answer::Double(_) | Answer::Text(_), _) => None,
    }
}

#[expect(
    clippy::cast_precision_loss,
    clippy::cast_possible_truncation,
    reason = "the range was checked in the line before"
)]
fn convert(kind: Kind, value: Answer<'_>) -> Option<Answer<'static>> {
    match (kind, value) {
        (Kind::Int, Answer::Int(number)) => Some(Answer::Int(number)),
        (Kind::Double, Answer::Double(number)) => Some(Answer::Double(number)),
        (Kind::Double, Answer::Int(number)) => Some(Answer::Double(number as f64)),
        (Kind::Int, Answer::Double(number)) => {
            let fits = (-9.2e18..9.2e18).contains(&number);
            fits.then_some(Answer::Int(number as i64))
        }
        (Kind::Bool | Kind::Int | Kind::Double | Kind::Text | Kind::List, _) => None,
    }
}
