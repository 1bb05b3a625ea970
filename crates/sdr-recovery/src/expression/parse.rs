//! From words to parts, with CEL's precedence.

use alloc::{format, string::String, vec::Vec};

use super::{
    DEPTH_MAX, ExpressionError, NODES_MAX,
    lex::{Token, Word},
    names::{Kind, Named, constant, names},
};

/// A part by its place in the list.
pub(super) type Id = usize;

/// One part, and where it stands.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Node {
    pub(super) at: usize,
    pub(super) width: usize,
    pub(super) part: Part,
}

#[derive(Clone, Debug, PartialEq)]
pub(super) enum Part {
    Bool(bool),
    Int(i64),
    Double(f64),
    Text(String),
    Fact(Named),
    /// `has(robot.rssi)`: whether it is known.
    Has(Named),
    List(Vec<Id>),
    Not(Id),
    Minus(Id),
    Two(Operator, Id, Id),
    Choose(Id, Id, Id),
    /// `double(x)` or `int(x)`.
    Convert(Kind, Id),
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Operator {
    Or,
    And,
    Equal,
    Unequal,
    Less,
    AtMost,
    Greater,
    AtLeast,
    In,
    Plus,
    Minus,
    Times,
    Divided,
    Modulo,
}

impl Operator {
    pub(super) fn sign(self) -> &'static str {
        match self {
            Self::Or => "||",
            Self::And => "&&",
            Self::Equal => "==",
            Self::Unequal => "!=",
            Self::Less => "<",
            Self::AtMost => "<=",
            Self::Greater => ">",
            Self::AtLeast => ">=",
            Self::In => "in",
            Self::Plus => "+",
            Self::Minus => "-",
            Self::Times => "*",
            Self::Divided => "/",
            Self::Modulo => "%",
        }
    }
}

impl Node {
    pub(super) fn fact(&self) -> Option<Named> {
        match self.part {
            Part::Fact(named) | Part::Has(named) => Some(named),
            Part::Bool(_)
            | Part::Int(_)
            | Part::Double(_)
            | Part::Text(_)
            | Part::List(_)
            | Part::Not(_)
            | Part::Minus(_)
            | Part::Two(..)
            | Part::Choose(..)
            | Part::Convert(..) => None,
        }
    }
}

/// Operators by how tightly they bind, the loosest first; all bind to the left.
const LEVELS: [&[Operator]; 5] = [
    &[Operator::Or],
    &[Operator::And],
    &[
        Operator::Equal,
        Operator::Unequal,
        Operator::Less,
        Operator::AtMost,
        Operator::Greater,
        Operator::AtLeast,
        Operator::In,
    ],
    &[Operator::Plus, Operator::Minus],
    &[Operator::Times, Operator::Divided, Operator::Modulo],
];

type Parsed = Result<Id, ExpressionError>;

pub(super) fn parse(words: Vec<Word>, end: usize) -> Result<Vec<Node>, ExpressionError> {
    let mut parser = Parser { words, next: 0, end, nodes: Vec::new(), depth: 0 };
    parser.choose()?;
    match parser.words.get(parser.next) {
        None => Ok(parser.nodes),
        Some(word) => {
            let (at, width) = (word.at, word.width);
            Err(ExpressionError::new(at, width, "the expression ends before this", "an operator"))
        }
    }
}

struct Parser {
    words: Vec<Word>,
    next: usize,
    end: usize,
    nodes: Vec<Node>,
    depth: usize,
}

impl Parser {
    /// `a ? b : c`, and all that binds more tightly.
    fn choose(&mut self) -> Parsed {
        self.depth += 1;
        if self.depth > DEPTH_MAX {
            let help = format!("at most {DEPTH_MAX} brackets, `!`, `-` or `?` within each other");
            return Err(self.error("the expression is nested too deeply", help));
        }
        let test = self.two(0)?;
        let whole = if self.take("?") {
            let first = self.choose()?;
            self.expect(":")?;
            let second = self.choose()?;
            self.add_over(test, second, Part::Choose(test, first, second))?
        } else {
            test
        };
        self.depth -= 1;
        Ok(whole)
    }

    fn two(&mut self, level: usize) -> Parsed {
        let Some(operators) = LEVELS.get(level) else { return self.one() };
        let mut left = self.two(level + 1)?;
        while let Some(operator) = self.operator(operators) {
            let right = self.two(level + 1)?;
            left = self.add_over(left, right, Part::Two(operator, left, right))?;
        }
        Ok(left)
    }

    fn operator(&mut self, operators: &[Operator]) -> Option<Operator> {
        let found = match &self.words.get(self.next)?.token {
            Token::Sign(sign) => operators.iter().find(|one| one.sign() == *sign),
            Token::Name(name) => operators.iter().find(|one| one.sign() == name),
            Token::Int(_) | Token::Double(_) | Token::Text(_) => None,
        };
        self.next += usize::from(found.is_some());
        found.copied()
    }

    /// `!a`, `-a`, and what stands for itself.
    fn one(&mut self) -> Parsed {
        let at = self.at();
        let not = self.take("!");
        if !not && !self.take("-") {
            return self.single();
        }
        self.depth += 1;
        if self.depth > DEPTH_MAX {
            return Err(self.error("the expression is nested too deeply", "fewer `!` and `-`"));
        }
        let inner = self.one()?;
        self.depth -= 1;
        let width = self.end_of(inner) - at;
        self.add(at, width, if not { Part::Not(inner) } else { Part::Minus(inner) })
    }

    fn single(&mut self) -> Parsed {
        let Some(Word { at, width, token }) = self.words.get(self.next).cloned() else {
            return Err(self.error("the expression breaks off", "a fact, a number or a text"));
        };
        self.next += 1;
        match token {
            Token::Int(number) => self.add(at, width, Part::Int(number)),
            Token::Double(number) => self.add(at, width, Part::Double(number)),
            Token::Text(text) => self.add(at, width, Part::Text(text)),
            Token::Name(name) => self.named(&name, at, width),
            Token::Sign("(") => {
                let inner = self.choose()?;
                self.expect(")")?;
                Ok(inner)
            }
            Token::Sign("[") => self.list(at),
            Token::Sign(sign) => {
                let message = format!("`{sign}` stands where a value is due");
                Err(ExpressionError::new(at, width, message, "a fact, a number or a text"))
            }
        }
    }

    fn list(&mut self, at: usize) -> Parsed {
        let mut items = Vec::new();
        while !self.take("]") {
            if !items.is_empty() {
                self.expect(",")?;
            }
            items.push(self.choose()?);
        }
        let width = self.before() - at;
        self.add(at, width, Part::List(items))
    }

    fn named(&mut self, name: &str, at: usize, width: usize) -> Parsed {
        match name {
            "true" | "false" => return self.add(at, width, Part::Bool(name == "true")),
            "has" if self.take("(") => {
                let (named, _) = self.path(None)?;
                self.expect(")")?;
                let width = self.before() - at;
                return self.add(at, width, Part::Has(named));
            }
            "double" | "int" if self.take("(") => {
                let inner = self.choose()?;
                self.expect(")")?;
                let kind = if name == "int" { Kind::Int } else { Kind::Double };
                let width = self.before() - at;
                return self.add(at, width, Part::Convert(kind, inner));
            }
            _ => {}
        }
        if let Some(number) = constant(name) {
            return self.add(at, width, Part::Double(number));
        }
        let (named, width) = self.path(Some((name.into(), at)))?;
        self.add(at, width, Part::Fact(named))
    }

    /// A fact's whole name, and how wide it is.
    fn path(&mut self, first: Option<(String, usize)>) -> Result<(Named, usize), ExpressionError> {
        let (mut path, at) = match first {
            Some(first) => first,
            None => self.name()?,
        };
        while self.take(".") {
            let (part, _) = self.name()?;
            path = format!("{path}.{part}");
        }
        let width = self.before() - at;
        if let Some(named) = Named::of_name(&path) {
            return Ok((named, width));
        }
        if matches!(self.words.get(self.next).map(|word| &word.token), Some(Token::Sign("("))) {
            let message = format!("unknown function `{path}`");
            return Err(ExpressionError::new(at, width, message, "has, int, double"));
        }
        let message = format!("unknown fact `{path}`");
        Err(ExpressionError::new(at, width, message, near(&path)))
    }

    fn name(&mut self) -> Result<(String, usize), ExpressionError> {
        let word = self.words.get(self.next).cloned();
        match word {
            Some(Word { at, token: Token::Name(name), .. }) => {
                self.next += 1;
                Ok((name, at))
            }
            Some(_) | None => Err(self.error("a name is due here", near(""))),
        }
    }

    fn take(&mut self, sign: &str) -> bool {
        let is_there = |word: &Word| matches!(word.token, Token::Sign(found) if found == sign);
        let found = self.words.get(self.next).is_some_and(is_there);
        self.next += usize::from(found);
        found
    }

    fn expect(&mut self, sign: &str) -> Result<(), ExpressionError> {
        if self.take(sign) {
            return Ok(());
        }
        Err(self.error(format!("`{sign}` is missing"), format!("`{sign}` here")))
    }

    /// Where the next word begins.
    fn at(&self) -> usize {
        self.words.get(self.next).map_or(self.end, |word| word.at)
    }

    /// Where the word before ends.
    fn before(&self) -> usize {
        self.words[self.next - 1].at + self.words[self.next - 1].width
    }

    fn end_of(&self, node: Id) -> usize {
        self.nodes[node].at + self.nodes[node].width
    }

    fn error(
        &self,
        message: impl alloc::string::ToString,
        help: impl alloc::string::ToString,
    ) -> ExpressionError {
        let width = self.words.get(self.next).map_or(1, |word| word.width);
        ExpressionError::new(self.at(), width, message, help)
    }

    fn add_over(&mut self, first: Id, last: Id, part: Part) -> Parsed {
        let at = self.nodes[first].at;
        self.add(at, self.end_of(last) - at, part)
    }

    fn add(&mut self, at: usize, width: usize, part: Part) -> Parsed {
        if self.nodes.len() >= NODES_MAX {
            let help = format!("at most {NODES_MAX} operators, names and numbers");
            return Err(ExpressionError::new(at, width, "the expression is too long", help));
        }
        self.nodes.push(Node { at, width, part });
        Ok(self.nodes.len() - 1)
    }
}

/// The facts that may have been meant: those of the same family, or all.
fn near(path: &str) -> String {
    let family = path.split('.').next().unwrap_or_default();
    let of_family: Vec<&str> =
        names().map(Named::name).filter(|name| name.split('.').next() == Some(family)).collect();
    match of_family.as_slice() {
        [] => String::from("robot.*, links.*, component.* (docs/recovery.md lists them)"),
        some => some.join(", "),
    }
}
