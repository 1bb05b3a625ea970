//! Which crate may know which.

use cargo_metadata::{Dependency, DependencyKind, Package};

use super::tree::{expect_none, metadata, root};

/// May be linked into a core that has no operating system.
const PURE: [&str; 3] = ["sdr-core", "sdr-alloc", "sdr-recovery"];
/// All that pure crates may use, besides each other.
const PURE_USES: [&str; 4] = ["thiserror", "serde", "postcard", "blake3"];
/// May know everybody.
const ABOVE_ALL: [&str; 2] = ["sdr-tests", "sdr-benches"];

/// Whom a crate of ours may know, tests inside the crate included.
fn may_know(name: &str) -> &'static [&'static str] {
    match name {
        "sdr-core" => &[],
        "sdr-alloc" | "sdr-recovery" | "sdr-component" | "sdr-keys" => &["sdr-core"],
        "sdr-lab" => &["sdr-core", "sdr-alloc", "sdr-recovery"],
        "sdr-files" => &["sdr-core", "sdr-alloc", "sdr-recovery"],
        "sdr-agent" => {
            &["sdr-core", "sdr-alloc", "sdr-recovery", "sdr-files", "sdr-component", "sdr-keys"]
        }
        "sdr-cli" => &["sdr-core", "sdr-alloc", "sdr-recovery", "sdr-files", "sdr-lab", "sdr-keys"],
        "sdr-components" => &["sdr-core", "sdr-component", "sdr-lab"],
        stranger => {
            panic!("{stranger} is new: say here whom it may know, and why in docs/decisions")
        }
    }
}

fn ours() -> Vec<Package> {
    let metadata = metadata();
    metadata.workspace_packages().into_iter().cloned().collect()
}

fn names_of_ours(package: &Package) -> impl Iterator<Item = &Dependency> {
    package.dependencies.iter().filter(|dependency| dependency.path.is_some())
}

#[test]
fn crates_know_only_those_below_them() {
    let mut findings = Vec::new();
    for package in ours() {
        let name = package.name.as_str();
        if ABOVE_ALL.contains(&name) {
            continue;
        }
        for dependency in names_of_ours(&package) {
            if !may_know(name).contains(&dependency.name.as_str()) {
                findings.push(format!("{name} -> {}", dependency.name));
            }
        }
    }
    expect_none("arrows that ARCHITECTURE.md does not have", &findings);
}

#[test]
fn pure_crates_use_nothing_that_needs_an_operating_system() {
    let mut findings = Vec::new();
    for package in ours().iter().filter(|package| PURE.contains(&package.name.as_str())) {
        for dependency in &package.dependencies {
            let name = dependency.name.as_str();
            let allowed = PURE.contains(&name) || PURE_USES.contains(&name);
            if dependency.kind != DependencyKind::Development && !allowed {
                findings.push(format!("{} -> {name}", package.name));
            }
        }
        let lib = root().join("crates").join(package.name.as_str()).join("src/lib.rs");
        let text = std::fs::read_to_string(lib).unwrap();
        for promise in ["#![no_std]", "#![forbid(unsafe_code)]"] {
            if !text.lines().any(|line| line == promise) {
                findings.push(format!("{}: lib.rs lacks {promise}", package.name));
            }
        }
    }
    expect_none("pure crates are no_std, safe and small", &findings);
}

#[test]
fn every_crate_takes_lints_licence_and_edition_from_the_workspace() {
    let mut findings = Vec::new();
    for package in ours() {
        let text = std::fs::read_to_string(&package.manifest_path).unwrap();
        let name = &package.name;
        if !text.contains("[lints]\nworkspace = true") {
            findings.push(format!("{name}: no `[lints] workspace = true`"));
        }
        for key in ["edition", "license", "rust-version", "version"] {
            if !text.contains(&format!("\n{key}.workspace = true")) {
                findings.push(format!("{name}: no `{key}.workspace = true`"));
            }
        }
    }
    expect_none("one table of lints, one licence, one edition", &findings);
}

#[test]
fn versions_stand_in_the_workspace_alone() {
    let mut findings = Vec::new();
    for package in ours() {
        let text = std::fs::read_to_string(&package.manifest_path).unwrap();
        let mut in_dependencies = false;
        for line in text.lines() {
            if line.starts_with('[') {
                in_dependencies = line.contains("dependencies");
            } else if in_dependencies && !line.trim().is_empty() && !line.contains("workspace") {
                findings.push(format!("{}: {line}", package.name));
            }
        }
    }
    expect_none("write the version into [workspace.dependencies]", &findings);
}
