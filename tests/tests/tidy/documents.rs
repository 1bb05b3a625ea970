//! The documents name only what is there, and leave nothing out.

use std::path::Path;

use super::tree::{Page, expect_none, pages, root};

/// First words of paths that begin at the root.
const TOP: [&str; 9] = [
    "crates/",
    "components/",
    "tests/",
    "benches/",
    "docs/",
    "policies/",
    "systems/",
    "fuzz/",
    ".ci/",
];

/// What stands between single backticks; fenced blocks are left out.
fn code_spans(text: &str) -> Vec<String> {
    let mut spans = Vec::new();
    let mut fenced = false;
    for line in text.lines() {
        if line.trim_start().starts_with("```") {
            fenced = !fenced;
        } else if !fenced {
            spans.extend(line.split('`').skip(1).step_by(2).map(str::to_owned));
        }
    }
    spans
}

/// Targets of `[text](target)`; fenced blocks are left out.
fn links(text: &str) -> Vec<String> {
    let mut links = Vec::new();
    let mut fenced = false;
    for line in text.lines() {
        if line.trim_start().starts_with("```") {
            fenced = !fenced;
        } else if !fenced {
            let targets = line.split("](").skip(1).filter_map(|rest| rest.split(')').next());
            links.extend(targets.map(str::to_owned));
        }
    }
    links
}

fn documents() -> Vec<Page> {
    pages().into_iter().filter(|page| page.path.ends_with(".md")).collect()
}

#[test]
fn links_between_documents_lead_somewhere() {
    let mut findings = Vec::new();
    for page in documents() {
        let folder = root().join(&page.path).parent().map(Path::to_owned).unwrap();
        for link in links(&page.text) {
            let path = link.split('#').next().unwrap_or_default();
            let outside = path.contains("://") || path.starts_with("mailto:");
            if !outside && !path.is_empty() && !folder.join(path).exists() {
                findings.push(format!("{}: {link}", page.path));
            }
        }
    }
    expect_none("links to nowhere", &findings);
}

#[test]
fn every_path_named_in_the_documents_is_there() {
    let mut findings = Vec::new();
    for page in pages().iter().filter(|page| page.is_any(&[".md", ".rs"])) {
        for span in code_spans(&page.text) {
            // In sources, backticks may hold anything; of the documents they speak by name.
            if page.path.ends_with(".rs") && !span.starts_with("docs/") {
                continue;
            }
            let path = span.split([' ', ':']).next().unwrap_or_default();
            let gap = |word: &str| word.contains(['*', '<', '{', '$']) || word.contains("NAME");
            let whole = !path.split('/').any(gap);
            if TOP.iter().any(|top| path.starts_with(top)) && whole && !root().join(path).exists() {
                findings.push(format!("{}: `{span}`", page.path));
            }
        }
    }
    expect_none("files that are named and not there", &findings);
}

#[test]
fn every_folder_of_sources_has_a_place_in_the_architecture() {
    let text = std::fs::read_to_string(root().join("ARCHITECTURE.md")).unwrap();
    let mut findings = Vec::new();
    for page in pages().iter().filter(|page| page.path.ends_with(".rs")) {
        let mut words = page.path.split('/');
        if let (Some("crates"), Some(name), Some("src"), Some(room), Some(_)) =
            (words.next(), words.next(), words.next(), words.next(), words.next())
        {
            let room = format!("crates/{name}/src/{room}");
            // A type and its tests may share a folder that only carries the file's name.
            let alone = root().join(format!("{room}.rs")).exists();
            if !alone && !text.contains(&room) && !findings.contains(&room) {
                findings.push(room);
            }
        }
    }
    expect_none("rooms that ARCHITECTURE.md does not show", &findings);
}

#[test]
fn every_page_of_the_docs_can_be_reached_from_their_readme() {
    let listed = std::fs::read_to_string(root().join("docs/README.md")).unwrap();
    let mut findings = Vec::new();
    for page in documents() {
        if let Some(path) = page.path.strip_prefix("docs/")
            && path != "README.md"
            && !listed.contains(&format!("({path})"))
        {
            findings.push(page.path.clone());
        }
    }
    expect_none("pages that docs/README.md does not list", &findings);
}

#[test]
fn the_component_in_the_readme_is_the_one_that_is_compiled() {
    let readme = std::fs::read_to_string(root().join("README.md")).unwrap();
    let doc = std::fs::read_to_string(root().join("crates/sdr-component/src/lib.rs")).unwrap();
    let compiled: Vec<&str> =
        doc.lines().filter_map(|line| line.strip_prefix("//!")).map(str::trim).collect();
    let shown = readme.split("```rust\n").nth(1).and_then(|rest| rest.split("```").next());
    let shown = shown.expect("the README shows a component");
    let strange = shown.lines().map(str::trim).filter(|line| !compiled.contains(line));
    let findings: Vec<String> = strange.map(str::to_owned).collect();
    expect_none("lines that the doc test of sdr-component does not have", &findings);
}

/// First words in quotes behind calls that make an event.
fn event_kinds(text: &str) -> Vec<String> {
    const CALLS: [&str; 5] =
        ["Event::new(", ".event(", ".event_about(", "Occurrence::new(", "let kind = match state {"];
    let mut kinds = Vec::new();
    for call in CALLS {
        for rest in text.split(call).skip(1) {
            let quoted =
                rest.trim_start().strip_prefix('"').and_then(|word| word.split('"').next());
            kinds.extend(quoted.map(str::to_owned));
        }
    }
    kinds
}

#[test]
fn every_event_stands_in_the_contract() {
    let contract = std::fs::read_to_string(root().join("docs/events.md")).unwrap();
    let mut findings = Vec::new();
    let mut seen = 0;
    for page in pages().iter().filter(|page| page.path.ends_with(".rs")) {
        let of_agents = page.path.starts_with("crates/sdr-core/src/brain")
            || page.path.starts_with("crates/sdr-agent/src");
        if !of_agents || page.path.contains("test") {
            continue;
        }
        for kind in event_kinds(&page.text) {
            seen += 1;
            let listed = contract.contains(&format!("`{kind}`"));
            // a message of the event stream itself, not an event
            if !listed && !contract.contains(&format!("`event: {kind}`")) {
                findings.push(format!("{}: {kind}", page.path));
            }
        }
    }
    assert!(seen > 25, "the search found only {seen} events: has their making changed?");
    expect_none("events that docs/events.md does not list", &findings);
}
