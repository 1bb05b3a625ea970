//! Types, as CEL has them: no operator takes two kinds, but comparisons of numbers.

use alloc::{format, vec::Vec};

use super::{
    ExpressionError,
    names::Kind,
    parse::{Node, Operator, Part},
};

pub(super) fn check(nodes: &[Node]) -> Result<(), ExpressionError> {
    let mut kinds: Vec<Kind> = Vec::with_capacity(nodes.len());
    for node in nodes {
        let kind = kind_of(node, nodes, &kinds)?;
        kinds.push(kind);
    }
    let (Some(whole), Some(kind)) = (nodes.last(), kinds.last()) else {
        return Err(ExpressionError::new(
            0,
            1,
            "the expression is empty",
            "such as robot.cpu > 0.9",
        ));
    };
    match kind {
        Kind::Bool => Ok(()),
        Kind::Int | Kind::Double | Kind::Text | Kind::List => {
            let message = format!("the expression is {}", kind.word());
            Err(refuse(whole, message, "one that is true or false"))
        }
    }
}

fn kind_of(node: &Node, nodes: &[Node], kinds: &[Kind]) -> Result<Kind, ExpressionError> {
    let wants = |id: usize, kind: Kind| {
        if kinds[id] == kind {
            return Ok(());
        }
        let message = format!("{} stands where {} is due", kinds[id].word(), kind.word());
        Err(refuse(&nodes[id], message, kind.word()))
    };
    Ok(match &node.part {
        Part::Bool(_) | Part::Has(_) => Kind::Bool,
        Part::Int(_) => Kind::Int,
        Part::Double(_) => Kind::Double,
        Part::Text(_) => Kind::Text,
        Part::Fact(named) => named.kind(),
        Part::Not(inner) => {
            wants(*inner, Kind::Bool)?;
            Kind::Bool
        }
        Part::Minus(inner) => {
            number(&nodes[*inner], kinds[*inner])?;
            kinds[*inner]
        }
        Part::Convert(kind, inner) => {
            number(&nodes[*inner], kinds[*inner])?;
            *kind
        }
        Part::Choose(test, first, second) => {
            wants(*test, Kind::Bool)?;
            wants(*second, kinds[*first])?;
            kinds[*first]
        }
        Part::List(items) => {
            for item in items {
                wants(*item, kinds[items[0]])?;
                if kinds[*item] == Kind::List {
                    return Err(refuse(&nodes[*item], "a list within a list", "numbers or texts"));
                }
            }
            Kind::List
        }
        Part::Two(operator, left, right) => {
            two(node, *operator, (kinds[*left], kinds[*right]), nodes, *right)?
        }
    })
}

fn two(
    node: &Node,
    operator: Operator,
    (left, right): (Kind, Kind),
    nodes: &[Node],
    right_id: usize,
) -> Result<Kind, ExpressionError> {
    let numbers =
        matches!(left, Kind::Int | Kind::Double) && matches!(right, Kind::Int | Kind::Double);
    let same = left == right;
    let (fits, kind, allowed) = match operator {
        Operator::Or | Operator::And => (same && left == Kind::Bool, Kind::Bool, "two bools"),
        Operator::Equal | Operator::Unequal => {
            let fits = numbers || (same && left != Kind::List);
            (fits, Kind::Bool, "two numbers, two texts or two bools")
        }
        Operator::Less | Operator::AtMost | Operator::Greater | Operator::AtLeast => {
            (numbers || (same && left == Kind::Text), Kind::Bool, "two numbers or two texts")
        }
        Operator::In => {
            let fits = right == Kind::List && in_list(left, &nodes[right_id], nodes);
            (fits, Kind::Bool, "a value and a list of such values")
        }
        Operator::Plus | Operator::Minus | Operator::Times | Operator::Divided => {
            (numbers && same, left, "two doubles or two ints; 3 is int, 3.0 is double")
        }
        Operator::Modulo => (numbers && same && left == Kind::Int, left, "two ints"),
    };
    if fits {
        return Ok(kind);
    }
    let message = format!("`{}` of {} and {}", operator.sign(), left.word(), right.word());
    Err(refuse(node, message, allowed))
}

/// Whether a value of this kind may be among the items; lists are of one kind already.
fn in_list(kind: Kind, list: &Node, nodes: &[Node]) -> bool {
    let Part::List(items) = &list.part else { return false };
    items.first().is_none_or(|first| match (&nodes[*first].part, kind) {
        (Part::Text(_), Kind::Text) | (Part::Int(_), Kind::Int) => true,
        (Part::Double(_), Kind::Double) | (Part::Bool(_), Kind::Bool) => true,
        (
            Part::Text(_)
            | Part::Int(_)
            | Part::Double(_)
            | Part::Bool(_)
            | Part::Fact(_)
            | Part::Has(_)
            | Part::List(_)
            | Part::Not(_)
            | Part::Minus(_)
            | Part::Two(..)
            | Part::Choose(..)
            | Part::Convert(..),
            _,
        ) => false,
    })
}

fn number(node: &Node, kind: Kind) -> Result<(), ExpressionError> {
    match kind {
        Kind::Int | Kind::Double => Ok(()),
        Kind::Bool | Kind::Text | Kind::List => {
            let message = format!("{} stands where a number is due", kind.word());
            Err(refuse(node, message, "int or double"))
        }
    }
}

fn refuse(
    node: &Node,
    message: impl alloc::string::ToString,
    help: impl alloc::string::ToString,
) -> ExpressionError {
    ExpressionError::new(node.at, node.width, message, help)
}
