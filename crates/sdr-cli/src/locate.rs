//! Finds the programs that are built together with `sdr`: they lie beside it.

use std::{
    collections::BTreeSet,
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

/// Sees that the agent and these component executables are beside `sdr`; one failure names all
/// that are not.
pub(crate) fn all<'a>(components: impl IntoIterator<Item = &'a str>) -> Result<(), Failure> {
    let components = components.into_iter().map(|name| (name, "sdr-components"));
    let wanted: Vec<_> = std::iter::once(("sdr-agent", "sdr-agent")).chain(components).collect();
    all_beside(&folder()?, &wanted)
}

/// `folder/name` when it can be run, else a failure that names the command which builds it.
fn beside(folder: &Path, name: &str, package: &str) -> Result<PathBuf, Failure> {
    all_beside(folder, &[(name, package)]).map(|()| folder.join(name))
}

fn all_beside(folder: &Path, wanted: &[(&str, &str)]) -> Result<(), Failure> {
    let missing: Vec<_> =
        wanted.iter().filter(|(name, _)| !is_program(&folder.join(name))).collect();
    if missing.is_empty() {
        return Ok(());
    }
    let names: Vec<&str> = missing.iter().map(|(name, _)| *name).collect();
    let packages: BTreeSet<&str> = missing.iter().map(|(_, package)| *package).collect();
    let packages: Vec<String> = packages.iter().map(|package| format!("-p {package}")).collect();
    let release = if folder.ends_with("debug") { "" } else { "--release " };
    Err(Failure::new(format!(
        "no program {} in {} (looked beside sdr)\n  Build:   cargo build {release}{}",
        names.join(", "),
        folder.display(),
        packages.join(" ")
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
    fn all_that_is_missing_is_named_at_once() {
        let folder = tempfile::tempdir().unwrap();
        let wanted = [("sdr-agent", "sdr-agent"), ("eye", "parts"), ("ear", "parts")];

        let text = sentence(all_beside(folder.path(), &wanted).unwrap_err());

        assert!(text.contains("sdr-agent, eye, ear"), "{text}");
        assert!(text.ends_with("cargo build --release -p parts -p sdr-agent"), "{text}");
    }

    #[test]
    fn a_file_that_cannot_be_run_is_no_program() {
        let folder = tempfile::tempdir().unwrap();
        std::fs::write(folder.path().join("sdr-agent"), "text").unwrap();
        assert!(beside(folder.path(), "sdr-agent", "sdr-agent").is_err());
        assert!(beside(Path::new("/bin"), "sh", "none").is_ok());
    }
}
