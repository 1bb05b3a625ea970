//! The only place that writes to stdout and stderr.

use std::{
    env,
    io::{self, IsTerminal, Write},
};

use clap::ValueEnum;
use serde::Serialize;

use crate::failure::Failure;

/// Width when stdout is no terminal.
pub(crate) const COLUMNS: usize = 80;

/// The form of answers: text for people, or JSON alone on stdout for programs.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, ValueEnum)]
pub(crate) enum Format {
    #[default]
    Text,
    Json,
}

/// Where answers go.
#[derive(Debug)]
pub(crate) struct Output {
    format: Format,
}

impl Output {
    pub(crate) fn new(format: Format) -> Self {
        Self { format }
    }

    pub(crate) fn format(&self) -> Format {
        self.format
    }

    /// Writes to stdout as it is, at once.
    pub(crate) fn text(&self, text: &str) -> Result<(), Failure> {
        let mut stdout = io::stdout().lock();
        stdout.write_all(text.as_bytes())?;
        Ok(stdout.flush()?)
    }

    /// Writes one line to stdout.
    pub(crate) fn line(&self, line: &str) -> Result<(), Failure> {
        self.text(&format!("{line}\n"))
    }

    /// Writes one JSON value and a line end to stdout.
    pub(crate) fn json(&self, value: &impl Serialize) -> Result<(), Failure> {
        let text = serde_json::to_string(value)
            .map_err(|error| Failure::new(format!("cannot print the answer: {error}")))?;
        self.line(&text)
    }

    /// Writes one line to stderr.
    pub(crate) fn note(&self, line: &str) -> Result<(), Failure> {
        let mut stderr = io::stderr().lock();
        writeln!(stderr, "{line}")?;
        Ok(stderr.flush()?)
    }

    /// Writes bytes to stdout as they came, at once.
    pub(crate) fn bytes(&self, bytes: &[u8]) -> Result<(), Failure> {
        let mut stdout = io::stdout().lock();
        stdout.write_all(bytes)?;
        Ok(stdout.flush()?)
    }

    /// Progress: stdout for people, stderr when stdout belongs to a program.
    pub(crate) fn progress(&self, text: &str) -> Result<(), Failure> {
        match self.format {
            Format::Text => self.text(text),
            Format::Json => {
                let mut stderr = io::stderr().lock();
                stderr.write_all(text.as_bytes())?;
                Ok(stderr.flush()?)
            }
        }
    }

    /// Whether progress may be drawn over itself: a terminal, and nobody asked for plainness.
    pub(crate) fn may_redraw(&self) -> bool {
        let terminal = match self.format {
            Format::Text => io::stdout().is_terminal(),
            Format::Json => io::stderr().is_terminal(),
        };
        let plain = env::var_os("NO_COLOR").is_some_and(|value| !value.is_empty());
        let dumb = env::var_os("TERM").is_some_and(|value| value == "dumb");
        terminal && !plain && !dumb
    }

    /// Columns and rows of the terminal that progress goes to; 80 x 24 when there is none.
    pub(crate) fn size(&self) -> (usize, usize) {
        let size = match self.format {
            Format::Text => rustix::termios::tcgetwinsize(io::stdout()),
            Format::Json => rustix::termios::tcgetwinsize(io::stderr()),
        };
        match size {
            Ok(size) if size.ws_col > 0 && size.ws_row > 0 => {
                (usize::from(size.ws_col), usize::from(size.ws_row))
            }
            Ok(_) | Err(_) => (COLUMNS, 24),
        }
    }
}
