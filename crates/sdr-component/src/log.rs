//! The component's log: its standard error, which the agent keeps in a file.

use std::fmt;
use std::io::Write;

/// Writes one line to the component's log; a log that is gone is no fault of the component.
pub fn log(line: fmt::Arguments<'_>) {
    let _ = writeln!(std::io::stderr().lock(), "{line}");
}
