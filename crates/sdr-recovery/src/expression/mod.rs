//! Expressions for what a table cannot say: a part of CEL, checked whole when it is read.
//!
//! ```text
//!  text ─▶ lex ─▶ parse ─▶ check (names, types) ─▶ Expression ─▶ eval(facts) ─▶ true, false,
//!                 depth     of every part                        cannot tell
//! ```
//!
//! What is here means what it means in CEL; comprehensions, maps, durations and regular
//! expressions are not here. So the time of an evaluation is bounded by [`NODES_MAX`], and
//! nothing but arithmetic can go wrong while it runs.

mod check;
mod eval;
mod lex;
mod names;
mod parse;

use alloc::{
    string::{String, ToString},
    vec::Vec,
};

use serde::{Deserialize, Serialize};
use thiserror::Error;

pub(crate) use eval::Answer;
pub(crate) use names::Counted;
pub use names::{Kind, Named, names};
use parse::Node;

/// Longest expression, in bytes.
pub const SOURCE_BYTES_MAX: usize = 400;
/// Deepest nesting.
pub const DEPTH_MAX: usize = 24;
/// Most operators, names and numbers.
pub const NODES_MAX: usize = 128;

/// A checked expression that says true or false of a component.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(try_from = "String", into = "String")]
pub struct Expression {
    source: String,
    /// Parts before what they are part of; the last is the whole.
    nodes: Vec<Node>,
}

/// The source says all; numbers within are never NaN.
impl Eq for Expression {}

/// Why a text is no expression. Its author can mend it.
#[derive(Clone, Debug, PartialEq, Eq, Error)]
#[error("{message}")]
pub struct ExpressionError {
    /// Where, in bytes from the beginning.
    pub at: usize,
    /// How many bytes are meant, at least 1.
    pub width: usize,
    /// What is wrong there.
    pub message: String,
    /// What is allowed.
    pub help: String,
}

impl ExpressionError {
    fn new(at: usize, width: usize, message: impl ToString, help: impl ToString) -> Self {
        let (message, help) = (message.to_string(), help.to_string());
        Self { at, width: width.max(1), message, help }
    }
}

impl Expression {
    /// Reads and checks `source`.
    pub fn new(source: &str) -> Result<Self, ExpressionError> {
        if source.len() > SOURCE_BYTES_MAX {
            let message = alloc::format!("an expression of {} bytes", source.len());
            let help = alloc::format!("at most {SOURCE_BYTES_MAX}");
            return Err(ExpressionError::new(0, 1, message, help));
        }
        let nodes = parse::parse(lex::lex(source)?, source.len())?;
        check::check(&nodes)?;
        Ok(Self { source: source.to_string(), nodes })
    }

    /// The text.
    pub fn source(&self) -> &str {
        &self.source
    }

    /// The facts that it looks at.
    pub fn facts(&self) -> impl Iterator<Item = Named> + '_ {
        self.nodes.iter().filter_map(Node::fact)
    }

    /// Whether it looks at nothing but the robot and its links.
    pub fn is_of_robot(&self) -> bool {
        let mut facts = self.facts().peekable();
        facts.peek().is_some() && facts.all(|fact| !fact.name().starts_with("component."))
    }

    /// What it says of these facts; `None` when that cannot be told.
    pub(crate) fn holds<'a>(&'a self, facts: &dyn Fn(Named) -> Option<Answer<'a>>) -> Option<bool> {
        eval::holds(&self.nodes, facts)
    }
}

impl TryFrom<String> for Expression {
    type Error = ExpressionError;

    fn try_from(source: String) -> Result<Self, ExpressionError> {
        Self::new(&source)
    }
}

impl From<Expression> for String {
    fn from(expression: Expression) -> Self {
        expression.source
    }
}

#[cfg(test)]
mod tests;
