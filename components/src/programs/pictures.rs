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
    /// A file that is no picture.
    #[error("cannot read the picture {}: {source}", file.display())]
    File {
        /// Which one.
        file: PathBuf,
        /// What the decoder said.
        source: image::ImageError,
    },
}

/// Shows the pictures of a folder in the order of their names, scaled to one size.
#[derive(Debug)]
pub struct Pictures {
    files: Vec<PathBuf>,
    size: (u32, u32),
    kept: Vec<Picture>,
    next: usize,
    /// The last one that was too many to be kept.
    passing: Picture,
}

impl Pictures {
    /// Lists the folder and reads its first picture.
    pub fn open(folder: &Path, size: (u32, u32)) -> Result<Self, PicturesError> {
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
        let first = read(&files[0], size)?;
        Ok(Self { files, size, kept: vec![first], next: 0, passing: Picture::default() })
    }

    /// The next picture; after the last comes the first.
    pub fn next_picture(&mut self) -> Result<&Picture, PicturesError> {
        let index = self.next;
        if index >= self.kept.len() {
            let picture = read(&self.files[index], self.size)?;
            if index >= KEPT_MAX {
                self.passing = picture;
                self.next = (index + 1) % self.files.len();
                return Ok(&self.passing);
            }
            self.kept.push(picture);
        }
        self.next = (index + 1) % self.files.len();
        Ok(&self.kept[index])
    }
}

fn is_picture(path: &Path) -> bool {
    let ending = path.extension().and_then(|ending| ending.to_str()).unwrap_or_default();
    ["png", "jpg", "jpeg"].iter().any(|known| ending.eq_ignore_ascii_case(known))
}

fn read(file: &Path, (width, height): (u32, u32)) -> Result<Picture, PicturesError> {
    let failed = |source| PicturesError::File { file: file.to_owned(), source };
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
        let mut pictures = Pictures::open(folder.path(), (8, 6)).unwrap();

        let mut reds = Vec::new();
        for _ in 0..4 {
            let picture = pictures.next_picture().unwrap();
            assert_eq!((picture.width, picture.height, picture.rgb.len()), (8, 6, 144));
            reds.push(picture.rgb[0]);
        }

        assert_eq!(reds, [1, 2, 3, 1]);
    }

    #[test]
    fn a_folder_without_pictures_and_a_broken_picture_are_named() {
        let folder = tempfile::tempdir().unwrap();
        let empty = Pictures::open(folder.path(), (8, 6)).unwrap_err().to_string();
        assert!(empty.contains("has 0 pictures"), "{empty}");
        let missing = Pictures::open(&folder.path().join("x"), (8, 6)).unwrap_err().to_string();
        assert!(missing.contains("cannot read the folder"), "{missing}");

        std::fs::write(folder.path().join("a.png"), "no picture").unwrap();
        let broken = Pictures::open(folder.path(), (8, 6)).unwrap_err().to_string();
        assert!(broken.contains("a.png"), "{broken}");
    }
}
