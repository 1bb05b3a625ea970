//! Length and words of files that people write.

use std::io::{self, Write as _};

use super::tree::{Page, expect_none, pages, root};

/// A file longer than this has a second subject inside.
const LINES_MAX: usize = 400;
/// From here on it is worth a thought.
const LINES_LONG: usize = 250;
/// Names that say nothing of what is inside.
const EMPTY_NAMES: [&str; 6] =
    ["utils.rs", "util.rs", "common.rs", "helpers.rs", "misc.rs", "prelude.rs"];

const CODE: [&str; 4] = [".rs", ".py", ".sh", ".ci/run"];
const WRITTEN: [&str; 9] =
    [".rs", ".py", ".sh", ".ci/run", ".toml", ".yaml", ".json", ".md", ".msg"];

/// Lines with their numbers, from 1.
fn lines(page: &Page) -> impl Iterator<Item = (usize, &str)> {
    page.text.lines().enumerate().map(|(index, line)| (index + 1, line))
}

/// Whether `word` stands in `line` with no letter, digit or `_` touching it.
fn holds_word(line: &str, word: &str) -> bool {
    let touches = |neighbour: Option<char>| {
        neighbour.is_some_and(|neighbour| neighbour.is_alphanumeric() || neighbour == '_')
    };
    line.match_indices(word).any(|(at, _)| {
        let (before, rest) = line.split_at(at);
        !touches(before.chars().next_back()) && !touches(rest[word.len()..].chars().next())
    })
}

fn is_test(page: &Page) -> bool {
    page.path.starts_with("tests/") || page.path.contains("/tests/") || page.path.contains("tests.")
}

#[test]
fn files_have_one_subject() {
    let mut findings = Vec::new();
    let mut long = Vec::new();
    for page in pages().iter().filter(|page| page.is_any(&CODE)) {
        let count = page.text.lines().count();
        if count > LINES_MAX {
            findings.push(format!("{}: {count} lines", page.path));
        } else if count > LINES_LONG {
            long.push(format!("  {count} {}\n", page.path));
        }
    }
    long.sort();
    // Straight to the terminal: the test runner keeps what a passing test prints.
    let told = write!(io::stderr(), "files over {LINES_LONG} lines:\n{}", long.concat());
    told.unwrap();
    expect_none(&format!("longer than {LINES_MAX} lines: split by subject"), &findings);
}

#[test]
fn files_are_named_for_what_is_inside() {
    let pages = pages();
    let named = pages.iter().filter(|page| EMPTY_NAMES.contains(&page.name()));
    let findings: Vec<String> = named.map(|page| page.path.clone()).collect();
    expect_none("names that say nothing", &findings);
}

#[test]
fn nothing_is_left_for_later() {
    // In two halves each, so that this file does not find itself.
    let words = [concat!("TO", "DO"), concat!("FIX", "ME"), concat!("XX", "X")];
    let calls = [concat!("todo", "!("), concat!("unimplemented", "!("), concat!("dbg", "!(")];
    let mut findings = Vec::new();
    for page in pages().iter().filter(|page| page.is_any(&WRITTEN) && !page.path.ends_with(".md")) {
        for (number, line) in lines(page) {
            let word = words.iter().find(|word| holds_word(line, word));
            let call = calls.iter().find(|call| line.contains(**call));
            if let Some(found) = word.or(call) {
                findings.push(format!("{}:{number}: {found}", page.path));
            }
        }
    }
    expect_none("finish it, or leave it out and say so in the docs", &findings);
}

#[test]
fn tests_run_always_and_wait_for_conditions() {
    let ignored = concat!("#[ign", "ore");
    let sleeps =
        [concat!("sleep(Duration::", "from_secs"), concat!("sleep(time::Duration::", "from_secs")];
    let mut findings = Vec::new();
    for page in pages().iter().filter(|page| page.path.ends_with(".rs")) {
        for (number, line) in lines(page) {
            if line.contains(ignored) {
                findings.push(format!("{}:{number}: an ignored test", page.path));
            }
            if is_test(page) && sleeps.iter().any(|sleep| line.contains(sleep)) {
                findings.push(format!("{}:{number}: sleeps for seconds", page.path));
            }
        }
    }
    expect_none("tests wait for a condition, and none is skipped", &findings);
}

#[test]
fn code_is_deleted_and_not_commented_out() {
    let mut findings = Vec::new();
    for page in pages().iter().filter(|page| page.path.ends_with(".rs")) {
        for (number, line) in lines(page) {
            let line = line.trim_start();
            let doc = line.starts_with("///") || line.starts_with("//!");
            let Some(text) = line.strip_prefix("//").filter(|_| !doc) else { continue };
            if text.ends_with(';') || text.ends_with(" {") || text.trim() == "}" {
                findings.push(format!("{}:{number}: {line}", page.path));
            }
        }
    }
    expect_none("comments say why; git remembers old code", &findings);
}

#[test]
fn no_file_knows_the_machine_it_was_written_on() {
    let folders = [concat!("/wo", "rk/"), concat!("/ro", "ot/"), concat!("/home/", "user")];
    let hosts = [concat!("crates", ".io"), concat!("pypi", ".org"), concat!("/opt/", "wheels")];
    let mut findings = Vec::new();
    for page in pages().iter().filter(|page| page.is_any(&WRITTEN)) {
        for (number, line) in lines(page) {
            if let Some(found) = folders.iter().chain(&hosts).find(|word| line.contains(**word)) {
                findings.push(format!("{}:{number}: {found}", page.path));
            }
        }
    }
    expect_none("paths and hosts of one machine", &findings);
}

#[test]
fn scripts_can_be_started() {
    use std::os::unix::fs::PermissionsExt as _;
    let mut findings = Vec::new();
    for page in pages().iter().filter(|page| page.text.starts_with("#!")) {
        // `#![attributes]` of Rust begin alike.
        let mode = std::fs::metadata(root().join(&page.path)).unwrap().permissions().mode();
        if !page.path.ends_with(".rs") && mode & 0o111 == 0 {
            findings.push(page.path.clone());
        }
    }
    expect_none("chmod +x", &findings);
}
