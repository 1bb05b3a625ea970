//! Blobs on this robot's disk, named by their hash.

use std::collections::BTreeSet;
use std::fs::{self, File};
use std::io::{self, Read as _, Write as _};
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::time::SystemTime;

use sdr_core::blob::{Blob, BlobHash};
use thiserror::Error;

/// Largest blob, bytes.
pub(crate) const BLOB_BYTES_MAX: u64 = 64 << 20;

/// Why a blob is not kept. Nothing changed.
#[derive(Debug, Error)]
pub(crate) enum StoreError {
    /// Larger than any may be, or than all together may be.
    #[error("{length} bytes; a blob has at most {allowed}")]
    TooLarge {
        /// How large it is.
        length: u64,
        /// How large it may be.
        allowed: u64,
    },
    /// The bytes are not those of its name.
    #[error("the bytes are blob {found}, not {wanted}")]
    Hash {
        /// What came.
        found: BlobHash,
        /// What was wanted.
        wanted: BlobHash,
    },
    /// The system refused.
    #[error("{}: {source}", path.display())]
    Io {
        /// Where.
        path: PathBuf,
        /// What the system said.
        source: io::Error,
    },
}

/// Who keeps what was brought.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Keep {
    /// The store.
    Here,
    /// Whoever asked.
    Elsewhere,
}

/// A folder of blobs with a quota, and beside it one of parts of systems, which stay as long as
/// a record names them; cheap to clone.
#[derive(Clone, Debug)]
pub(crate) struct BlobStore {
    folder: Arc<PathBuf>,
    parts: Arc<PathBuf>,
    quota: u64,
}

impl BlobStore {
    /// The store in `state`, whose folders are made; all blobs together take at most `quota`
    /// bytes: those that were used least lately go first. Parts are bounded by the brain.
    pub(crate) fn open(state: &Path, quota: u64) -> Result<Self, StoreError> {
        let (folder, parts) = (state.join("blobs"), state.join("parts"));
        for made in [&folder, &parts] {
            fs::create_dir_all(made).map_err(at(made))?;
        }
        Ok(Self { folder: Arc::new(folder), parts: Arc::new(parts), quota })
    }

    /// Keeps parts of systems until [`BlobStore::sweep_parts`] does not name them.
    pub(crate) fn keep_parts(&self, parts: &[Blob]) -> Result<(), StoreError> {
        for Blob { hash, bytes } in parts {
            let path = self.parts.join(hash.to_string());
            if matches!(read_bounded(&path), Ok(Some(there)) if there == **bytes) {
                continue;
            }
            write_whole(&path.with_extension("new"), &path, bytes)?;
        }
        Ok(())
    }

    /// Removes all parts but those named.
    pub(crate) fn sweep_parts(&self, named: &BTreeSet<BlobHash>) -> Result<(), StoreError> {
        for entry in fs::read_dir(&*self.parts).map_err(at(&self.parts))?.flatten() {
            let hash = entry.file_name().to_str().and_then(BlobHash::parse);
            if hash.is_none_or(|hash| !named.contains(&hash)) {
                remove(&entry.path())?;
            }
        }
        Ok(())
    }

    /// Keeps a blob; its name.
    pub(crate) fn put(&self, bytes: &[u8]) -> Result<BlobHash, StoreError> {
        let hash = BlobHash::of(bytes);
        if self.read(&hash)?.is_none() {
            self.make_room(length(bytes))?;
            write_whole(&self.part(&hash), &self.path(&hash), bytes)?;
        }
        Ok(hash)
    }

    /// The bytes of a blob, when it is here. One that was damaged on the disk is not.
    pub(crate) fn read(&self, hash: &BlobHash) -> Result<Option<Vec<u8>>, StoreError> {
        if let Some(bytes) = read_bounded(&self.parts.join(hash.to_string()))?
            && BlobHash::of(&bytes) == *hash
        {
            return Ok(Some(bytes));
        }
        let path = self.path(hash);
        let Some(bytes) = read_bounded(&path)? else { return Ok(None) };
        if BlobHash::of(&bytes) != *hash {
            fs::remove_file(&path).map_err(at(&path))?;
            return Ok(None);
        }
        // For the order in which blobs go; a clock that is wrong costs a fetch.
        if let Ok(file) = File::options().append(true).open(&path) {
            let _ = file.set_modified(SystemTime::now());
        }
        Ok(Some(bytes))
    }

    /// What came of a blob so far, of a transfer that broke.
    pub(super) fn partial(&self, hash: &BlobHash) -> Result<Vec<u8>, StoreError> {
        Ok(read_bounded(&self.part(hash))?.unwrap_or_default())
    }

    /// Keeps what came of a blob whose transfer broke.
    pub(super) fn keep_partial(&self, hash: &BlobHash, bytes: &[u8]) -> Result<(), StoreError> {
        self.make_room(length(bytes))?;
        let part = self.part(hash);
        fs::write(&part, bytes).map_err(at(&part))
    }

    /// Ends a transfer, and forgets what came of it: the bytes must be those of `hash`. They
    /// are kept, unless whoever asked keeps them.
    pub(super) fn finish(
        &self,
        hash: &BlobHash,
        bytes: &[u8],
        keep: Keep,
    ) -> Result<(), StoreError> {
        let part = self.part(hash);
        let found = BlobHash::of(bytes);
        if found != *hash {
            remove(&part)?;
            return Err(StoreError::Hash { found, wanted: *hash });
        }
        match keep {
            Keep::Here => drop(self.put(bytes)?),
            Keep::Elsewhere => {}
        }
        remove(&part)
    }

    /// Removes what was used least lately until `more` bytes fit.
    fn make_room(&self, more: u64) -> Result<(), StoreError> {
        let allowed = self.quota.min(BLOB_BYTES_MAX);
        if more > allowed {
            return Err(StoreError::TooLarge { length: more, allowed });
        }
        let wrong = at(&self.folder);
        let mut files = Vec::new();
        for entry in fs::read_dir(&*self.folder).map_err(wrong)?.flatten() {
            if let Ok(facts) = entry.metadata() {
                let used = facts.modified().unwrap_or(SystemTime::UNIX_EPOCH);
                files.push((used, facts.len(), entry.path()));
            }
        }
        files.sort();
        let mut total: u64 = files.iter().map(|(_, length, _)| length).sum();
        for (_, length, path) in files {
            if total.saturating_add(more) <= self.quota {
                break;
            }
            remove(&path)?;
            total -= length;
        }
        Ok(())
    }

    fn path(&self, hash: &BlobHash) -> PathBuf {
        self.folder.join(hash.to_string())
    }

    fn part(&self, hash: &BlobHash) -> PathBuf {
        self.folder.join(format!("{hash}.part"))
    }
}

fn length(bytes: &[u8]) -> u64 {
    u64::try_from(bytes.len()).unwrap_or(u64::MAX)
}

fn read_bounded(path: &Path) -> Result<Option<Vec<u8>>, StoreError> {
    let file = match File::open(path) {
        Ok(file) => file,
        Err(error) if error.kind() == io::ErrorKind::NotFound => return Ok(None),
        Err(error) => return Err(at(path)(error)),
    };
    let mut bytes = Vec::new();
    file.take(BLOB_BYTES_MAX).read_to_end(&mut bytes).map_err(at(path))?;
    Ok(Some(bytes))
}

/// Replaces `path` as a whole, by way of `temporary`.
fn write_whole(temporary: &Path, path: &Path, bytes: &[u8]) -> Result<(), StoreError> {
    let written = File::create(temporary).and_then(|mut file| {
        file.write_all(bytes)?;
        file.sync_all()
    });
    written.and_then(|()| fs::rename(temporary, path)).map_err(at(temporary))
}

fn remove(path: &Path) -> Result<(), StoreError> {
    match fs::remove_file(path) {
        Err(error) if error.kind() != io::ErrorKind::NotFound => Err(at(path)(error)),
        Ok(()) | Err(_) => Ok(()),
    }
}

fn at(path: &Path) -> impl Fn(io::Error) -> StoreError {
    let path = path.to_owned();
    move |source| StoreError::Io { path: path.clone(), source }
}
