//! Files in tests/golden: what is told about bad ones, and that good ones are taken.
//!
//! `BLESS=1 cargo test -p sdr-files` rewrites the expected texts. Systems whose name begins
//! with `link_` are also held against the profiles in tests/golden/profiles.json.

use std::{
    fs,
    path::{Path, PathBuf},
};

use sdr_core::spec::ComponentProfile;
use sdr_files::{
    LoadedFile, Problems, link_profiles, load_any, parse_system,
    robot::{Places, parse_robot},
};

fn golden() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../../tests/golden")
}

fn files(folder: &Path) -> Vec<PathBuf> {
    let mut files: Vec<PathBuf> = fs::read_dir(folder)
        .expect("the folder of the repository")
        .map(|entry| entry.expect("an entry of the folder").path())
        .filter(|path| path.extension().is_some_and(|word| word == "toml" || word == "yaml"))
        .collect();
    files.sort();
    files
}

fn load(path: &Path) -> Result<LoadedFile, Problems> {
    let mut loaded = load_any(path)?;
    let linked = path.file_name().is_some_and(|name| name.to_string_lossy().starts_with("link_"));
    if let (LoadedFile::System(system), true) = (&mut loaded, linked) {
        let profiles = fs::read_to_string(golden().join("profiles.json")).expect("profiles.json");
        let profiles: Vec<ComponentProfile> = serde_json::from_str(&profiles).expect("profiles");
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
    let policies = ["policies/allocation", "policies/recovery", "policies/role"];
    for folder in ["tests/golden/good", "systems", "tests/scenarios", "tests/scenarios/systems"]
        .into_iter()
        .chain(policies)
    {
        for path in files(&root.join(folder)) {
            if let Err(problems) = load(&path) {
                panic!("{problems}");
            }
        }
    }
}

/// Every beginning of the file, and the file without each single line.
fn broken(text: &str) -> impl Iterator<Item = String> {
    let beginnings = text.char_indices().map(|(at, _)| text[..at].to_owned());
    let lines: Vec<String> = text.lines().map(str::to_owned).collect();
    let without = (0..lines.len()).map(move |index| {
        let mut lines = lines.clone();
        lines.remove(index);
        lines.join("\n")
    });
    beginnings.chain(without)
}

#[test]
fn a_broken_file_is_refused_with_a_place_or_taken_and_never_a_panic() {
    let root = golden().join("../..");
    let system = fs::read_to_string(root.join("tests/golden/good/link_pair.yaml")).unwrap();
    let robot = fs::read_to_string(root.join("tests/golden/good/robot.toml")).unwrap();
    let places = Places::of_this_process();
    let told = broken(&system)
        .filter_map(|text| parse_system("s.yaml", &text, &root).err())
        .chain(broken(&robot).filter_map(|text| parse_robot("r.toml", &text, &places).err()));

    let mut refused = 0;
    for problems in told {
        refused += 1;
        assert!(!problems.as_slice().is_empty() && !problems.to_string().is_empty());
    }

    assert!(refused > 100, "{refused}");
}
