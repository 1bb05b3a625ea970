//! The folder of `--images`, looked through before anything starts.

use std::{
    fs::{self, File},
    io::Read,
    path::{Path, PathBuf},
};

use crate::{failure::Failure, render::units::count};

/// How files of these kinds begin; what is in a file counts, whatever its name ends in.
const BEGINNINGS: [&[u8]; 2] = [b"\x89PNG\r\n\x1a\n", b"\xff\xd8\xff"];

/// A folder with at least one picture.
#[derive(Debug)]
pub(super) struct Folder {
    /// Its real path.
    pub(super) path: PathBuf,
    /// Files that begin as pictures do.
    pictures: usize,
    /// Files that are only called so.
    others: usize,
}

impl Folder {
    /// Looks at every file whose name says that it is a picture.
    pub(super) fn new(folder: &Path) -> Result<Self, Failure> {
        let wrong = |error: std::io::Error| {
            Failure::Usage(format!("--images {}: {error}", folder.display()))
        };
        let (mut pictures, mut others) = (0, 0);
        for entry in fs::read_dir(folder).map_err(wrong)? {
            let path = entry.map_err(wrong)?.path();
            match is_called_picture(&path) {
                true if begins_as_picture(&path) => pictures += 1,
                true => others += 1,
                false => {}
            }
        }
        if pictures == 0 {
            let called = match others {
                0 => String::new(),
                _ => format!(" ({} called so, but not one is)", count(others, "file")),
            };
            return Err(Failure::Usage(format!(
                "--images {}: no picture there{called}; allowed: a folder with *.png, *.jpg or *.jpeg",
                folder.display()
            )));
        }
        Ok(Self { path: fs::canonicalize(folder).map_err(wrong)?, pictures, others })
    }

    /// `12 pictures in /dir, 1 other passed over`.
    pub(super) fn sentence(&self) -> String {
        let others = match self.others {
            0 => String::new(),
            number => format!(", {} passed over", count(number, "unreadable file")),
        };
        format!("{}{others} in {}", count(self.pictures, "picture"), self.path.display())
    }
}

fn is_called_picture(path: &Path) -> bool {
    let word = path.extension().and_then(|word| word.to_str()).map(str::to_ascii_lowercase);
    matches!(word.as_deref(), Some("png" | "jpg" | "jpeg"))
}

fn begins_as_picture(path: &Path) -> bool {
    let mut begin = Vec::new();
    let read = File::open(path).and_then(|file| file.take(8).read_to_end(&mut begin));
    read.is_ok() && BEGINNINGS.iter().any(|known| begin.starts_with(known))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn refusal(folder: &Path) -> String {
        match Folder::new(folder) {
            Err(Failure::Usage(text)) => text,
            other => panic!("{other:?}"),
        }
    }

    #[test]
    fn a_folder_without_pictures_is_wrong_usage() {
        let folder = tempfile::tempdir().unwrap();
        fs::write(folder.path().join("notes.txt"), "x").unwrap();
        assert!(refusal(folder.path()).contains("no picture there; allowed: a folder with *.png"));
        assert!(refusal(&folder.path().join("no")).contains("/no: "));
        fs::write(folder.path().join("A.PNG"), "x").unwrap();
        assert!(refusal(folder.path()).contains("1 file called so, but not one is"));
    }

    #[test]
    fn pictures_are_counted_and_what_is_none_is_told() {
        let folder = tempfile::tempdir().unwrap();
        fs::write(folder.path().join("a.png"), b"\x89PNG\r\n\x1a\nmore").unwrap();
        fs::write(folder.path().join("b.JPEG"), b"\xff\xd8\xff\xe0").unwrap();
        fs::write(folder.path().join("c.jpg"), "").unwrap();
        let text = Folder::new(folder.path()).unwrap().sentence();
        assert!(text.starts_with("2 pictures, 1 unreadable file passed over in /"), "{text}");
    }
}
