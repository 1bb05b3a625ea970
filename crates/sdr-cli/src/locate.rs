//! Finds the programs that are built together with `sdr`: they lie beside it.

use std::{
    env,
    path::{Path, PathBuf},
};

use rustix::fs::{Access, access};

use crate::failure::Failure;

/// The folder of the running `sdr`.
pub(crate) fn folder() -> Result<PathBuf, Failure> {
    let program = env::current_exe()
        .map_err(|error| Failure::new(format!("cannot tell where sdr itself lies: {error}")))?;
    Ok(program.parent().map_or_else(|| PathBuf::from("."), Path::to_path_buf))
}

/// `sdr-agent` beside `sdr`.
pub(crate) fn agent() -> Result<PathBuf, Failure> {
    beside(&folder()?, "sdr-agent", "sdr-agent")
}

/// The component executable `name` beside `sdr`.
pub(crate) fn component(name: &str) -> Result<PathBuf, Failure> {
    beside(&folder()?, name, "sdr-components")
}

/// `folder/name` when it can be run, else a failure that names the command which builds it.
fn beside(folder: &Path, name: &str, package: &str) -> Result<PathBuf, Failure> {
    let path = folder.join(name);
    if is_program(&path) {
        return Ok(path);
    }
    let release = if folder.ends_with("debug") { "" } else { "--release " };
    Err(Failure::new(format!(
        "no program {} (looked beside sdr)\n  Build it:   cargo build {release}-p {package}",
        path.display()
    )))
}

/// Whether `path` is a file that this user may run.
pub(crate) fn is_program(path: &Path) -> bool {
    path.is_file() && access(path, Access::EXEC_OK).is_ok()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn sentence(failure: Failure) -> String {
        match failure {
            Failure::Failed(answer) => answer.error,
            Failure::Usage(text) => text,
            Failure::Closed => String::new(),
        }
    }

    #[test]
    fn a_missing_program_names_the_command_that_builds_it() {
        let folder = tempfile::tempdir().unwrap();
        let failure = beside(folder.path(), "fisheye", "sdr-components").unwrap_err();
        let text = sentence(failure);
        assert!(text.contains("cargo build --release -p sdr-components"), "{text}");
        assert!(text.contains("fisheye"), "{text}");
    }

    #[test]
    fn a_file_that_cannot_be_run_is_no_program() {
        let folder = tempfile::tempdir().unwrap();
        std::fs::write(folder.path().join("sdr-agent"), "text").unwrap();
        assert!(beside(folder.path(), "sdr-agent", "sdr-agent").is_err());
        assert!(beside(Path::new("/bin"), "sh", "none").is_ok());
    }
}
