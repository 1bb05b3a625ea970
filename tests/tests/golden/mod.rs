//! A policy file and a journal of evidence give exactly these verdicts: one journal for each
//! row of Table III, and for what is ours.
//!
//! `BLESS=1 cargo test -p sdr-tests golden` rewrites the expected lines.

mod journal;

use std::{
    fs,
    path::{Path, PathBuf},
};

use journal::Journal;

fn root() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("..")
}

#[test]
fn each_row_of_the_table_gives_the_verdicts_expected() {
    let folder = root().join("tests/golden/recovery");
    let mut files: Vec<PathBuf> =
        fs::read_dir(&folder).unwrap().map(|entry| entry.unwrap().path()).collect();
    files.retain(|path| path.extension().is_some_and(|word| word == "journal"));
    files.sort();
    let mut differences = Vec::new();
    for path in &files {
        let journal = Journal::read(&fs::read_to_string(path).unwrap(), &root());
        let found = journal.unwrap_or_else(|error| panic!("{}: {error}", path.display())).play();
        let expected_path = path.with_extension("txt");
        if std::env::var_os("BLESS").is_some() {
            fs::write(&expected_path, &found).unwrap();
        }
        let expected = fs::read_to_string(&expected_path).unwrap_or_default();
        if found != expected || found.is_empty() {
            differences.push(format!("--- {}\n{found}", path.display()));
        }
    }
    assert!(files.len() >= 20, "only {} journals", files.len());
    assert!(differences.is_empty(), "{}", differences.join("\n"));
}
