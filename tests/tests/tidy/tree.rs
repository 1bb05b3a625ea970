//! The files of the repository, and what cargo says of its crates.

use std::{
    fs,
    path::{Path, PathBuf},
};

use cargo_metadata::{Metadata, MetadataCommand};

/// Folders that are made, not written.
const MADE: [&str; 6] = ["target", ".git", ".venv", "__pycache__", "corpus", "artifacts"];

/// One file of text.
pub(super) struct Page {
    /// Seen from the root, such as `docs/README.md`.
    pub(super) path: String,
    pub(super) text: String,
}

impl Page {
    /// The last word of the path.
    pub(super) fn name(&self) -> &str {
        self.path.rsplit('/').next().unwrap_or(&self.path)
    }

    /// Whether the name ends with one of these.
    pub(super) fn is_any(&self, endings: &[&str]) -> bool {
        endings.iter().any(|ending| self.path.ends_with(ending))
    }
}

/// The root of the repository.
pub(super) fn root() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).parent().expect("tests/ lies in the root").into()
}

/// Every file of text, by path.
pub(super) fn pages() -> Vec<Page> {
    let mut pages = Vec::new();
    gather(&root(), "", &mut pages);
    pages.sort_by(|one, other| one.path.cmp(&other.path));
    assert!(pages.len() > 100, "only {} files found below {:?}", pages.len(), root());
    pages
}

fn gather(folder: &Path, prefix: &str, pages: &mut Vec<Page>) {
    for entry in fs::read_dir(folder).expect("folders of the repository can be read") {
        let entry = entry.expect("a folder stays while it is read");
        let name = entry.file_name().into_string().expect("names of files are UTF-8");
        let path = format!("{prefix}{name}");
        if entry.file_type().expect("every file has a type").is_dir() {
            // A demo or a scenario leaves its report where it was started.
            if !MADE.contains(&name.as_str())
                && !name.starts_with("sdr-demo-")
                && !name.starts_with("sdr-lab-")
            {
                gather(&entry.path(), &format!("{path}/"), pages);
            }
        } else if let Ok(text) = fs::read_to_string(entry.path()) {
            pages.push(Page { path, text });
        }
    }
}

/// The workspace with all its dependencies, as built for this machine.
pub(super) fn metadata() -> Metadata {
    let host = format!("{}-unknown-linux-gnu", std::env::consts::ARCH);
    MetadataCommand::new()
        .manifest_path(root().join("Cargo.toml"))
        .other_options(["--filter-platform".to_owned(), host])
        .exec()
        .expect("cargo can read the workspace")
}

/// Fails with all findings at once.
pub(super) fn expect_none(rule: &str, findings: &[String]) {
    assert!(findings.is_empty(), "{rule}:\n  {}\n", findings.join("\n  "));
}
