//! Words of an expression.

use alloc::{format, string::String, vec::Vec};

use super::{ExpressionError, NODES_MAX};

/// One word and where it stands, in bytes.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Word {
    pub(super) at: usize,
    pub(super) width: usize,
    pub(super) token: Token,
}

#[derive(Clone, Debug, PartialEq)]
pub(super) enum Token {
    Int(i64),
    Double(f64),
    Text(String),
    /// A name without its points: `robot`.
    Name(String),
    /// An operator, a bracket, a point or a comma.
    Sign(&'static str),
}

/// Longer signs first, so that `<=` is not `<` and `=`.
const SIGNS: [&str; 22] = [
    "&&", "||", "==", "!=", "<=", ">=", "<", ">", "!", "+", "-", "*", "/", "%", "?", ":", "(", ")",
    "[", "]", ",", ".",
];

/// Brackets and points are no nodes, so there may be more words than nodes.
const WORDS_MAX: usize = 4 * NODES_MAX;

pub(super) fn lex(source: &str) -> Result<Vec<Word>, ExpressionError> {
    let mut words = Vec::new();
    let mut at = 0;
    while let Some(first) = source[at..].chars().next() {
        if first.is_ascii_whitespace() {
            at += 1;
            continue;
        }
        let rest = &source[at..];
        let (token, width) = if first.is_ascii_digit() {
            number(rest, at)?
        } else if first.is_ascii_alphabetic() || first == '_' {
            let width = run(rest, |c| c.is_ascii_alphanumeric() || c == '_');
            (Token::Name(rest[..width].into()), width)
        } else if first == '"' || first == '\'' {
            text(rest, first, at)?
        } else if let Some(sign) = SIGNS.iter().find(|sign| rest.starts_with(**sign)) {
            (Token::Sign(sign), sign.len())
        } else {
            let help =
                "names of facts, numbers, \"text\", && || ! == != < <= > >= + - * / % ? : in";
            let message = format!("`{first}` means nothing here");
            return Err(ExpressionError::new(at, first.len_utf8(), message, help));
        };
        words.push(Word { at, width, token });
        at += width;
        if words.len() > WORDS_MAX {
            let help = format!("at most {NODES_MAX} operators, names and numbers");
            return Err(ExpressionError::new(at, 1, "the expression is too long", help));
        }
    }
    Ok(words)
}

/// Bytes at the beginning that are all `fine`; only ASCII is asked for.
fn run(text: &str, fine: impl Fn(char) -> bool) -> usize {
    text.find(|c| !fine(c)).unwrap_or(text.len())
}

fn number(rest: &str, at: usize) -> Result<(Token, usize), ExpressionError> {
    let digits = |from: usize| from + run(&rest[from..], |c| c.is_ascii_digit());
    let mut end = digits(0);
    let mut whole = true;
    if rest[end..].starts_with('.') && rest[end + 1..].starts_with(|c: char| c.is_ascii_digit()) {
        end = digits(end + 1);
        whole = false;
    }
    if rest[end..].starts_with(['e', 'E']) {
        let sign = usize::from(rest[end + 1..].starts_with(['+', '-']));
        let power = digits(end + 1 + sign);
        if power > end + 1 + sign {
            (end, whole) = (power, false);
        }
    }
    // `200MB` would be two words otherwise, with a riddle for an error.
    let tail = run(&rest[end..], |c| c.is_ascii_alphanumeric() || c == '_');
    if tail > 0 {
        let message = format!("`{}` is no number", &rest[..end + tail]);
        let help = "units are factors: 200.0 * MB (kB, MB, GB, MiB, GiB, ms)";
        return Err(ExpressionError::new(at, end + tail, message, help));
    }
    let word = &rest[..end];
    let token = if whole {
        word.parse().ok().map(Token::Int)
    } else {
        word.parse().ok().filter(|number: &f64| number.is_finite()).map(Token::Double)
    };
    match token {
        Some(token) => Ok((token, end)),
        None => {
            let help = "whole numbers of 64 bits, and numbers such as 0.5";
            Err(ExpressionError::new(at, end, format!("`{word}` is too large"), help))
        }
    }
}

fn text(rest: &str, quote: char, at: usize) -> Result<(Token, usize), ExpressionError> {
    let Some(len) = rest[1..].find(quote) else {
        let message = "the text does not end";
        return Err(ExpressionError::new(at, rest.len(), message, "a quote at its end"));
    };
    let inside = &rest[1..=len];
    if inside.contains('\\') {
        let message = "`\\` in a text";
        return Err(ExpressionError::new(at, len + 2, message, "text without escapes"));
    }
    Ok((Token::Text(inside.into()), len + 2))
}
