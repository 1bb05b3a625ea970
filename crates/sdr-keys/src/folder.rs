//! Files of keys: read with errors that say what to do, written whole, readable by one user.

use std::{
    fs::{self, File},
    io::{self, Write as _},
    os::unix::fs::{DirBuilderExt as _, OpenOptionsExt as _, PermissionsExt as _},
    path::{Path, PathBuf},
};

use thiserror::Error;

/// Largest file of keys, bytes.
const FILE_BYTES_MAX: u64 = 4 << 20;

/// Why keys cannot be used or made. Nothing was changed; the operator can mend it.
#[derive(Debug, Error)]
#[non_exhaustive]
pub enum KeysError {
    /// A file is not there.
    #[error("{}: there is no such file; {next}", file.display())]
    Missing {
        /// The file.
        file: PathBuf,
        /// What to do.
        next: String,
    },
    /// The system refused.
    #[error("{}: cannot {what}: {source}", file.display())]
    Io {
        /// The file or folder.
        file: PathBuf,
        /// What was tried.
        what: &'static str,
        /// What the system said.
        source: io::Error,
    },
    /// A file that says something else than it should.
    #[error("{}: {found}; allowed: {allowed}", file.display())]
    Malformed {
        /// The file.
        file: PathBuf,
        /// What was found, never a secret.
        found: String,
        /// What is allowed.
        allowed: String,
    },
    /// A secret that others of the machine can read.
    #[error("{}: others can read this secret (mode {mode:03o}); do: chmod 600 {}", file.display(), file.display())]
    Exposed {
        /// The file.
        file: PathBuf,
        /// Its permission bits.
        mode: u32,
    },
    /// Two files that do not belong together.
    #[error("{}: {found}; {next}", file.display())]
    Mismatch {
        /// The file.
        file: PathBuf,
        /// What does not fit.
        found: String,
        /// What to do.
        next: String,
    },
    /// Something is there that must not be overwritten.
    #[error("{}: {found}; {next}", place.display())]
    Taken {
        /// The file or folder.
        place: PathBuf,
        /// What is there.
        found: String,
        /// What to do.
        next: String,
    },
    /// A name that means nothing or too much.
    #[error("{0}")]
    Name(String),
}

/// Reads a file of public text.
pub(crate) fn read_text(path: &Path) -> Result<String, KeysError> {
    let length = fs::metadata(path).map_err(|source| absent(path, source))?.len();
    if length > FILE_BYTES_MAX {
        return Err(KeysError::Malformed {
            file: path.into(),
            found: format!("{length} bytes"),
            allowed: format!("at most {FILE_BYTES_MAX}"),
        });
    }
    fs::read_to_string(path).map_err(|source| absent(path, source))
}

/// Reads a secret, which nobody but its user may be able to read.
pub(crate) fn read_secret(path: &Path) -> Result<String, KeysError> {
    let text = read_text(path)?;
    let mode = fs::metadata(path).map_err(|source| absent(path, source))?.permissions().mode();
    match mode & 0o007 {
        0 => Ok(text),
        _ => Err(KeysError::Exposed { file: path.into(), mode: mode & 0o777 }),
    }
}

/// Makes a folder that only its user may enter; one that is there stays as it is.
pub(crate) fn make_private(path: &Path) -> Result<(), KeysError> {
    let made = fs::DirBuilder::new().recursive(true).mode(0o700).create(path);
    made.map_err(|source| KeysError::Io { file: path.into(), what: "make the folder", source })
}

/// Writes a file that only its user may read: whole or not at all, and on the disk when
/// this returns.
pub(crate) fn write_private(path: &Path, text: &str) -> Result<(), KeysError> {
    let wrong = |source| KeysError::Io { file: path.into(), what: "write", source };
    let beside = path.with_extension(format!("new{}", std::process::id()));
    let written = (|| {
        let mut file =
            File::options().write(true).create(true).truncate(true).mode(0o600).open(&beside)?;
        file.write_all(text.as_bytes())?;
        file.sync_all()?;
        fs::rename(&beside, path)?;
        path.parent().map_or(Ok(()), |folder| File::open(folder)?.sync_all())
    })();
    if written.is_err() {
        // It may not even have been made.
        let _ = fs::remove_file(&beside);
    }
    written.map_err(wrong)
}

fn absent(path: &Path, source: io::Error) -> KeysError {
    let file = path.into();
    match source.kind() == io::ErrorKind::NotFound {
        true => {
            let next = "`sdr keys add ROBOT` or `sdr keys operator NAME` makes a whole folder";
            KeysError::Missing { file, next: next.into() }
        }
        false => KeysError::Io { file, what: "read", source },
    }
}
