//! The programs under test, freshly built.

use std::{
    path::{Path, PathBuf},
    process::Command,
    sync::OnceLock,
};

/// Where the programs are.
#[derive(Debug)]
pub struct Programs {
    folder: PathBuf,
}

impl Programs {
    /// The folder of all of them.
    pub fn folder(&self) -> &Path {
        &self.folder
    }

    /// The operator's tool.
    pub fn sdr(&self) -> PathBuf {
        self.folder.join("sdr")
    }

    /// The agent.
    pub fn agent(&self) -> PathBuf {
        self.folder.join("sdr-agent")
    }
}

/// The programs, built once for all tests of this process.
pub fn programs() -> &'static Programs {
    static PROGRAMS: OnceLock<Programs> = OnceLock::new();
    PROGRAMS.get_or_init(build)
}

fn build() -> Programs {
    // target/debug/deps/main-1234 -> target/debug
    let own = std::env::current_exe().expect("a test has a path");
    let folder = own.ancestors().nth(2).expect("tests lie two folders deep").to_path_buf();
    let target = folder.parent().expect("profiles lie in the target folder");
    let status = Command::new(env!("CARGO"))
        .args(["build", "--quiet", "-p", "sdr-agent", "-p", "sdr-cli", "-p", "sdr-components"])
        .arg("--target-dir")
        .arg(target)
        .current_dir(Path::new(env!("CARGO_MANIFEST_DIR")).join(".."))
        .status()
        .expect("cargo runs");
    assert!(status.success(), "the programs under test do not build");
    Programs { folder }
}
