//! The folder of the report, made and tried before anything starts.

use std::{
    fs::{self, File},
    io,
    path::{Path, PathBuf},
};

use crate::failure::Failure;

/// Highest number that is tried for a folder of reports.
const FOLDERS_MAX: u32 = 10_000;

/// A folder that can be written to. When nothing was written, one that was made here goes again.
#[derive(Debug)]
pub(crate) struct Out {
    path: PathBuf,
    /// Those made here, the outermost first.
    made: Vec<PathBuf>,
}

impl Out {
    /// `wanted`, else the first free `STEM-N` below `parent`.
    pub(crate) fn new(wanted: Option<PathBuf>, parent: &Path, stem: &str) -> Result<Self, Failure> {
        let path = match wanted {
            Some(path) => path,
            None => free(parent, stem)?,
        };
        let missing = path.ancestors().take_while(|one| !is_there(one)).map(Path::to_path_buf);
        let made = missing.collect::<Vec<_>>().into_iter().rev().collect();
        let out = Self { path, made };
        out.attempt().map_err(|error| {
            Failure::new(format!(
                "cannot write the report to {}: {error}; nothing was started",
                out.path.display()
            ))
        })?;
        Ok(out)
    }

    /// Where it is.
    pub(crate) fn path(&self) -> &Path {
        &self.path
    }

    /// Makes it and writes a file of no use to it: rights alone do not tell what works.
    fn attempt(&self) -> io::Result<()> {
        fs::create_dir_all(&self.path)?;
        let probe = self.path.join(format!(".sdr-demo-{}", std::process::id()));
        File::create_new(&probe)?;
        fs::remove_file(probe)
    }
}

impl Drop for Out {
    fn drop(&mut self) {
        for folder in self.made.iter().rev() {
            // One that is not empty stays, and so do those around it.
            let _ = fs::remove_dir(folder);
        }
    }
}

/// The empty path before a relative one is the present folder.
fn is_there(path: &Path) -> bool {
    path.as_os_str().is_empty() || path.exists()
}

/// The first `STEM-N` that is not there yet.
fn free(parent: &Path, stem: &str) -> Result<PathBuf, Failure> {
    let folders = (1..=FOLDERS_MAX).map(|number| parent.join(format!("{stem}-{number}")));
    let free = folders.into_iter().find(|folder| !folder.exists());
    free.ok_or_else(|| {
        Failure::Usage(format!("{FOLDERS_MAX} reports are here already; give --out DIR"))
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn reports_are_numbered_and_none_is_overwritten() {
        let parent = tempfile::tempdir().unwrap();
        let first = Out::new(None, parent.path(), "sdr-demo").unwrap();
        assert!(first.path().ends_with("sdr-demo-1"));
        let second = Out::new(None, parent.path(), "sdr-demo").unwrap();
        assert!(second.path().ends_with("sdr-demo-2"));
    }

    #[test]
    fn a_folder_that_cannot_be_written_is_refused_before_the_start() {
        let parent = tempfile::tempdir().unwrap();
        let file = parent.path().join("file");
        fs::write(&file, "x").unwrap();
        for wrong in [PathBuf::from("/proc/nope"), file.join("below"), file] {
            match Out::new(Some(wrong.clone()), parent.path(), "sdr-demo") {
                Err(Failure::Failed(answer)) => {
                    assert!(answer.error.contains(&wrong.display().to_string()), "{answer:?}");
                }
                other => panic!("{other:?}"),
            }
        }
    }

    #[test]
    fn folders_made_for_a_report_that_never_came_go_and_others_stay() {
        let parent = tempfile::tempdir().unwrap();
        let deep = parent.path().join("a/b");
        drop(Out::new(Some(deep.clone()), parent.path(), "x").unwrap());
        assert!(parent.path().exists() && !parent.path().join("a").exists());

        let out = Out::new(Some(deep.clone()), parent.path(), "x").unwrap();
        fs::write(out.path().join("report.json"), "{}").unwrap();
        drop(out);
        assert!(deep.join("report.json").exists());

        let there = parent.path().join("there");
        fs::create_dir(&there).unwrap();
        drop(Out::new(Some(there.clone()), parent.path(), "x").unwrap());
        assert!(there.exists());
    }
}
