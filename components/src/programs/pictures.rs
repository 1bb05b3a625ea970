//! Pictures of a folder, round and round.

use std::io;
use std::path::{Path, PathBuf};

use image::{DynamicImage, imageops::FilterType};
use sdr_lab::optics::Picture;

/// Scaled pictures kept in memory; more are read anew each round.
const KEPT_MAX: usize = 512;
/// Most pictures of a folder.
const FILES_MAX: usize = 100_000;

/// A folder that cannot be shown. The operator can mend it.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum PicturesError {
    /// It cannot be listed.
    #[error("cannot read the folder of pictures {}: {source}", folder.display())]
    Folder {
        /// As given.
        folder: PathBuf,
        /// What the system said.
        source: io::Error,
    },
    /// Nothing to show, or far too much.
    #[error("{} has {found} pictures; allowed: 1 to {FILES_MAX} files ending in .png, .jpg or .jpeg", folder.display())]
    Count {
        /// As given.
        folder: PathBuf,
        /// How many there are.
        found: usize,
    },
    /// None of them can be read.
    #[error("none of the {found} pictures in {} can be read; the last: {last}", folder.display())]
    Unreadable {
        /// As given.
        folder: PathBuf,
        /// How many there are.
        found: usize,
        /// Why the last one cannot.
        last: Unreadable,
    },
}

/// A file that is passed over because it is no picture.
#[derive(Debug, thiserror::Error)]
#[error("cannot read the picture {}: {source}", file.display())]
pub struct Unreadable {
    /// Which one.
    pub file: PathBuf,
    /// What the decoder said.
    pub source: image::ImageError,
}

/// Shows the pictures of a folder in the order of their names, scaled to one size.
///
/// A file that cannot be read is told once and passed over; that none can be read is an error.
#[derive(Debug)]
pub struct Pictures {
    folder: PathBuf,
    files: Vec<PathBuf>,
    size: (u32, u32),
    kept: Vec<Picture>,
    next: usize,
    /// The last one that was too many to be kept.
    passing: Picture,
}

impl Pictures {
    /// Lists the folder and reads its first picture; `skipped` hears of those before it.
    pub fn open(
        folder: &Path,
        size: (u32, u32),
        skipped: &mut dyn FnMut(&Unreadable),
    ) -> Result<Self, PicturesError> {
        let failed = |source| PicturesError::Folder { folder: folder.to_owned(), source };
        let mut files = Vec::new();
        for entry in std::fs::read_dir(folder).map_err(failed)? {
            let path = entry.map_err(failed)?.path();
            if is_picture(&path) {
                files.push(path);
            }
        }
        if !(1..=FILES_MAX).contains(&files.len()) {
            let found = files.len();
            return Err(PicturesError::Count { folder: folder.to_owned(), found });
        }
        files.sort();
        let (folder, passing) = (folder.to_owned(), Picture::default());
        let mut pictures = Self { folder, files, size, kept: Vec::new(), next: 0, passing };
        let first = pictures.readable(skipped)?;
        pictures.kept.push(first);
        Ok(pictures)
    }

    /// The next picture; after the last comes the first. `skipped` hears of those passed over.
    pub fn next_picture(
        &mut self,
        skipped: &mut dyn FnMut(&Unreadable),
    ) -> Result<&Picture, PicturesError> {
        if self.next >= self.kept.len() {
            let picture = self.readable(skipped)?;
            // Passing over the last file leads back to the first, which is kept already.
            if self.next == self.kept.len() && self.next < KEPT_MAX {
                self.kept.push(picture);
            } else {
                self.passing = picture;
                self.next = (self.next + 1) % self.files.len();
                return Ok(&self.passing);
            }
        }
        let index = self.next;
        self.next = (index + 1) % self.files.len();
        Ok(&self.kept[index])
    }

    /// Reads the file whose turn it is, or the next one that can be read; the others are dropped.
    fn readable(&mut self, skipped: &mut dyn FnMut(&Unreadable)) -> Result<Picture, PicturesError> {
        let found = self.files.len();
        loop {
            let unreadable = match read(&self.files[self.next], self.size) {
                Ok(picture) => return Ok(picture),
                Err(unreadable) => unreadable,
            };
            skipped(&unreadable);
            self.files.remove(self.next);
            if self.files.is_empty() {
                let folder = self.folder.clone();
                return Err(PicturesError::Unreadable { folder, found, last: unreadable });
            }
            self.next %= self.files.len();
        }
    }
}

fn is_picture(path: &Path) -> bool {
    let ending = path.extension().and_then(|ending| ending.to_str()).unwrap_or_default();
    ["png", "jpg", "jpeg"].iter().any(|known| ending.eq_ignore_ascii_case(known))
}

fn read(file: &Path, (width, height): (u32, u32)) -> Result<Picture, Unreadable> {
    let failed = |source| Unreadable { file: file.to_owned(), source };
    let opened = image::ImageReader::open(file).map_err(|source| failed(source.into()))?;
    // What is in the file counts, whatever its name ends in.
    let guessed = opened.with_guessed_format().map_err(|source| failed(source.into()))?;
    let picture = guessed.decode().map_err(failed)?;
    let scaled = if (picture.width(), picture.height()) == (width, height) {
        picture
    } else {
        picture.resize_exact(width, height, FilterType::Triangle)
    };
    Ok(Picture { width: width as usize, height: height as usize, rgb: rgb_of(scaled) })
}

fn rgb_of(picture: DynamicImage) -> Vec<u8> {
    picture.into_rgb8().into_raw()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn paint(folder: &Path, name: &str, red: u8) {
        let picture = image::RgbImage::from_pixel(20, 10, image::Rgb([red, 0, 0]));
        picture.save(folder.join(name)).unwrap();
    }

    #[test]
    fn pictures_come_in_the_order_of_their_names_and_begin_again() {
        let folder = tempfile::tempdir().unwrap();
        for (name, red) in [("b.png", 2), ("a.PNG", 1), ("c.png", 3)] {
            paint(folder.path(), name, red);
        }
        std::fs::write(folder.path().join("notes.txt"), "no picture").unwrap();
        let mut pictures = Pictures::open(folder.path(), (8, 6), &mut never).unwrap();

        let mut reds = Vec::new();
        for _ in 0..4 {
            let picture = pictures.next_picture(&mut never).unwrap();
            assert_eq!((picture.width, picture.height, picture.rgb.len()), (8, 6, 144));
            reds.push(picture.rgb[0]);
        }

        assert_eq!(reds, [1, 2, 3, 1]);
    }

    #[test]
    fn an_unreadable_picture_is_told_once_and_passed_over() {
        let folder = tempfile::tempdir().unwrap();
        for name in ["a.png", "c.png", "e.png"] {
            std::fs::write(folder.path().join(name), "no picture").unwrap();
        }
        paint(folder.path(), "b.png", 1);
        paint(folder.path(), "d.png", 2);
        let mut told = Vec::new();
        let mut note = |one: &Unreadable| told.push(one.to_string());

        let mut pictures = Pictures::open(folder.path(), (8, 6), &mut note).unwrap();
        let mut reds = Vec::new();
        for _ in 0..5 {
            reds.push(pictures.next_picture(&mut note).unwrap().rgb[0]);
        }

        // The file at the end is found to be none when its turn comes; the first comes instead.
        assert_eq!(reds, [1, 2, 1, 2, 1]);
        assert_eq!(told.len(), 3, "{told:?}");
        for (line, name) in told.iter().zip(["a.png", "c.png", "e.png"]) {
            assert!(line.contains(name), "{line}");
        }
    }

    #[test]
    fn a_folder_with_nothing_to_show_is_named() {
        let folder = tempfile::tempdir().unwrap();
        let reason = |path: &Path| {
            Pictures::open(path, (8, 6), &mut |_| {}).map(drop).unwrap_err().to_string()
        };
        let empty = reason(folder.path());
        assert!(empty.contains("has 0 pictures"), "{empty}");
        let missing = reason(&folder.path().join("x"));
        assert!(missing.contains("cannot read the folder"), "{missing}");

        std::fs::write(folder.path().join("a.png"), "no picture").unwrap();
        let broken = reason(folder.path());
        assert!(broken.contains("none of the 1 pictures") && broken.contains("a.png"), "{broken}");
    }

    fn never(one: &Unreadable) {
        panic!("{one}");
    }
}
