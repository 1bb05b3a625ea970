//! What is wrong with a file, and where.

use std::{fmt, path::Path, sync::Arc};

/// One thing that is wrong with a file. The author of the file can mend it.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Problem {
    /// The file as it was named.
    pub file: String,
    /// Line, from 1; 0 when the problem is the whole file.
    pub line: u32,
    /// Column in characters, from 1.
    pub column: u32,
    /// How many characters are meant, at least 1.
    pub width: u32,
    /// What was found.
    pub message: String,
    /// What is allowed.
    pub help: Option<String>,
    /// The line as it stands in the file.
    pub snippet: String,
}

impl fmt::Display for Problem {
    /// `x.yaml:12:9: unknown key `rat`; allowed: rate, run`, then the line and a caret.
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}:", self.file)?;
        if self.line > 0 {
            write!(f, "{}:{}:", self.line, self.column)?;
        }
        write!(f, " {}", self.message)?;
        if let Some(help) = &self.help {
            write!(f, "; {help}")?;
        }
        if self.line == 0 {
            return Ok(());
        }
        let (shown, column) = self.window();
        let number = self.line.to_string();
        let margin = " ".repeat(number.len());
        let before: String = shown
            .chars()
            .take(column)
            .map(|character| if character == '\t' { '\t' } else { ' ' })
            .collect();
        let room = shown.chars().count().saturating_sub(column).max(1);
        let carets = "^".repeat((self.width as usize).clamp(1, room));
        write!(f, "\n  {number} | {shown}\n  {margin} | {before}{carets}")
    }
}

/// Longest part of a line that is shown, in characters.
const SHOWN_MAX: usize = 160;
/// Stands where a line was cut.
const CUT: &str = "...";

impl Problem {
    /// The part of the line around the column, and the column's place in it, from 0.
    fn window(&self) -> (String, usize) {
        let column = self.column.saturating_sub(1) as usize;
        if self.snippet.chars().count() <= SHOWN_MAX {
            return (self.snippet.clone(), column);
        }
        let start = column.saturating_sub(SHOWN_MAX / 2);
        let before = if start > 0 { CUT } else { "" };
        let part: String = self.snippet.chars().skip(start).take(SHOWN_MAX).collect();
        let after = if self.snippet.chars().nth(start + SHOWN_MAX).is_some() { CUT } else { "" };
        (format!("{before}{part}{after}"), before.len() + column - start)
    }
}

/// Everything that is wrong with a file, in the order of its lines; never empty.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Problems(Vec<Problem>);

impl Problems {
    /// The problems `found`, by file, line and column; `None` when there are none.
    pub fn new(mut found: Vec<Problem>) -> Option<Self> {
        let place = |problem: &Problem| (problem.file.clone(), problem.line, problem.column);
        found.sort_by_key(place);
        found.dedup();
        if found.is_empty() { None } else { Some(Self(found)) }
    }

    /// The problems of a reading that gave nothing; `found` holds why.
    pub(crate) fn of(found: Vec<Problem>) -> Self {
        Self::new(found).expect("a reading that gives nothing tells why")
    }

    /// The problems in order.
    pub fn as_slice(&self) -> &[Problem] {
        &self.0
    }
}

impl fmt::Display for Problems {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        for (index, problem) in self.0.iter().enumerate() {
            let gap = if index == 0 { "" } else { "\n" };
            write!(f, "{gap}{problem}")?;
        }
        Ok(())
    }
}

impl std::error::Error for Problems {}

impl IntoIterator for Problems {
    type Item = Problem;
    type IntoIter = std::vec::IntoIter<Problem>;

    fn into_iter(self) -> Self::IntoIter {
        self.0.into_iter()
    }
}

/// A place in a file.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Mark {
    pub(crate) line: u32,
    pub(crate) column: u32,
    pub(crate) width: u32,
}

impl Mark {
    /// The file as a whole.
    pub(crate) const FILE: Self = Self { line: 0, column: 0, width: 1 };
}

/// Longest file that is read.
pub(crate) const FILE_BYTES_MAX: u64 = 1_000_000;

/// A file's name and text, kept for the lines shown in problems.
#[derive(Clone, Debug)]
pub(crate) struct Source(Arc<SourceText>);

#[derive(Debug)]
struct SourceText {
    file: String,
    text: String,
}

impl Source {
    pub(crate) fn new(file: &str, text: &str) -> Self {
        // A byte order mark would shift the columns of the first line.
        let text = text.strip_prefix('\u{feff}').unwrap_or(text);
        Self(Arc::new(SourceText { file: file.to_owned(), text: text.to_owned() }))
    }

    /// Reads the file at `path`.
    pub(crate) fn load(path: &Path) -> Result<Self, Problems> {
        let file = path.display().to_string();
        let refuse = |message: String| {
            let whole = Self::new(&file, "");
            Problems(vec![whole.problem(Mark::FILE, message, None)])
        };
        let size = std::fs::metadata(path)
            .map_err(|error| refuse(format!("cannot be read: {error}")))?
            .len();
        if size > FILE_BYTES_MAX {
            return Err(refuse(format!("has {size} bytes; at most {FILE_BYTES_MAX} are read")));
        }
        let bytes =
            std::fs::read(path).map_err(|error| refuse(format!("cannot be read: {error}")))?;
        match String::from_utf8(bytes) {
            Ok(text) => Ok(Self::new(&file, &text)),
            Err(error) => {
                let at = error.utf8_error().valid_up_to();
                Err(refuse(format!("is not UTF-8 text: byte {at} is none")))
            }
        }
    }

    pub(crate) fn file(&self) -> &str {
        &self.0.file
    }

    pub(crate) fn text(&self) -> &str {
        &self.0.text
    }

    /// A problem at `mark`.
    pub(crate) fn problem(&self, mark: Mark, message: String, help: Option<String>) -> Problem {
        let index = mark.line.saturating_sub(1) as usize;
        let snippet = self.0.text.lines().nth(index).unwrap_or("").to_owned();
        let room = snippet.chars().count().saturating_sub(mark.column.saturating_sub(1) as usize);
        let width = mark.width.clamp(1, u32::try_from(room).unwrap_or(1).max(1));
        Problem {
            file: self.0.file.clone(),
            line: mark.line,
            column: mark.column,
            width,
            message,
            help,
            snippet,
        }
    }

    /// The mark of the bytes `start..end`; its width ends with the line.
    pub(crate) fn mark(&self, start: usize, end: usize) -> Mark {
        let text = &self.0.text;
        let clip = |at: usize| (0..=at.min(text.len())).rev().find(|at| text.is_char_boundary(*at));
        let start = clip(start).unwrap_or(0);
        let end = clip(end).unwrap_or(0).max(start);
        let line_start = text[..start].rfind('\n').map_or(0, |at| at + 1);
        let count = |part: &str| u32::try_from(part.chars().count()).unwrap_or(u32::MAX);
        let line = u32::try_from(text[..start].matches('\n').count()).unwrap_or(u32::MAX);
        let shown = text[start..end].lines().next().unwrap_or("");
        Mark {
            line: line.saturating_add(1),
            column: count(&text[line_start..start]).saturating_add(1),
            width: count(shown).max(1),
        }
    }
}
