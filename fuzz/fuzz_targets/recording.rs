//! Recordings as a report reads them: any bytes as a file, and any bodies in a well-formed one.
#![no_main]

use std::fs;

use libfuzzer_sys::fuzz_target;
use sdr_fuzz::{bytes::Choices, meter, recordings};

#[path = "../../crates/sdr-cli/src/report/read.rs"]
#[allow(dead_code, reason = "the report has more to ask")]
mod read;

fuzz_target!(|bytes: &[u8]| {
    let mut choices = Choices(bytes);
    let whole = choices.byte() % 2 == 1;
    let file = if whole { recordings::file(&mut choices) } else { choices.rest().to_vec() };
    let folder = tempfile::tempdir().expect("a folder");
    let path = folder.path().join("robot-1.mcap");
    fs::write(&path, &file).expect("a file");
    let allowed = (1 << 20) + 64 * file.len();
    match meter::at_most(allowed, || read::Recordings::read(&[path])) {
        Ok(recordings) => assert_eq!(recordings.files.len(), 1),
        Err(error) => assert!(!error.to_string().is_empty()),
    }
});
