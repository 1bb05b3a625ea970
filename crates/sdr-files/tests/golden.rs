//! Files in tests/golden: what is told about bad ones, and that good ones are taken.
//!
//! `BLESS=1 cargo test -p sdr-files` rewrites the expected texts. Systems whose name begins
//! with `link_` are also held against the profiles in tests/golden/profiles.json.

use std::{
    fs,
    path::{Path, PathBuf},
};

use sdr_core::spec::ComponentProfile;
use sdr_files::{LoadedFile, Problems, link_profiles, load_any};

fn golden() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../../tests/golden")
}

fn files(folder: &Path) -> Vec<PathBuf> {
    let mut files: Vec<PathBuf> = fs::read_dir(folder)
        .unwrap()
        .map(|entry| entry.unwrap().path())
        .filter(|path| path.extension().is_some_and(|word| word == "toml" || word == "yaml"))
        .collect();
    files.sort();
    files
}

fn load(path: &Path) -> Result<LoadedFile, Problems> {
    let mut loaded = load_any(path)?;
    let linked = path.file_name().is_some_and(|name| name.to_string_lossy().starts_with("link_"));
    if let (LoadedFile::System(system), true) = (&mut loaded, linked) {
        let profiles = fs::read_to_string(golden().join("profiles.json")).unwrap();
        let profiles: Vec<ComponentProfile> = serde_json::from_str(&profiles).unwrap();
        link_profiles(system, &profiles)?;
    }
    Ok(loaded)
}

#[test]
fn bad_files_are_refused_in_the_words_expected() {
    let folder = golden().join("bad");
    let mut differences = Vec::new();
    let files = files(&folder);
    for path in &files {
        let told = match load(path) {
            Ok(_) => String::from("nothing was told\n"),
            Err(problems) => format!("{problems}\n"),
        };
        let told = told.replace(&format!("{}/", folder.display()), "");
        let expected_path = path.with_extension("txt");
        if std::env::var_os("BLESS").is_some() {
            fs::write(&expected_path, &told).unwrap();
        }
        let expected = fs::read_to_string(&expected_path).unwrap_or_default();
        if told != expected || told.starts_with("nothing") {
            differences.push(format!("--- {}\n{told}", path.display()));
        }
    }
    assert!(files.len() >= 25, "only {} bad files", files.len());
    assert!(differences.is_empty(), "{}", differences.join("\n"));
}

#[test]
fn good_files_are_taken() {
    let root = golden().join("../..");
    let folders = ["tests/golden/good", "systems", "policies/allocation", "policies/recovery"];
    for folder in folders {
        for path in files(&root.join(folder)) {
            if let Err(problems) = load(&path) {
                panic!("{problems}");
            }
        }
    }
}
