//! The secret that all robots of a fleet share, and the file it lies in.

use std::{collections::BTreeMap, fmt, path::Path};

use ring::digest;

use crate::{folder::KeysError, hex};

/// Most keys in a file: the newest ones stay.
const KEYS_MAX: usize = 4;
/// The file's first line; the number is its format.
const HEAD: &str = "# sdr mesh keys 1: secret, one `ID KEY` a line";

/// Numbers the mesh keys of a fleet from 1; a rotation takes the next.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct KeyId(pub u16);

impl KeyId {
    /// The key after this one; `None` after 65,535 rotations.
    pub fn next(self) -> Option<Self> {
        self.0.checked_add(1).map(Self)
    }
}

impl fmt::Display for KeyId {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        self.0.fmt(f)
    }
}

/// A mesh key: 32 random bytes. Never shown, not even by `Debug`.
#[derive(Clone, PartialEq, Eq)]
pub struct MeshKey {
    id: KeyId,
    bytes: [u8; 32],
}

impl MeshKey {
    /// The key `bytes` under `id`.
    pub fn new(id: KeyId, bytes: [u8; 32]) -> Self {
        Self { id, bytes }
    }

    /// Its number.
    pub fn id(&self) -> KeyId {
        self.id
    }

    /// The secret itself: for sealing, and for whoever may have it.
    pub fn secret(&self) -> &[u8; 32] {
        &self.bytes
    }

    /// A public sign of the key, by which somebody who has the key can be told that it is
    /// the right one; the key cannot be found from it.
    pub fn check(&self) -> String {
        let mut text = b"sdr mesh key check".to_vec();
        text.extend(self.id.0.to_be_bytes());
        text.extend(self.bytes);
        hex::encode(&digest::digest(&digest::SHA256, &text).as_ref()[..16])
    }

    /// `ID KEY`, as files and messages between those who may have it carry it.
    pub fn to_line(&self) -> String {
        format!("{} {}", self.id, hex::encode(&self.bytes))
    }

    /// Reads [`MeshKey::to_line`].
    pub fn parse(line: &str) -> Option<Self> {
        let (id, key) = line.split_once(' ')?;
        let id: u16 = id.parse().ok().filter(|id| *id > 0)?;
        Some(Self { id: KeyId(id), bytes: hex::decode(key)? })
    }
}

impl fmt::Debug for MeshKey {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "MeshKey({}, ..)", self.id)
    }
}

/// The mesh keys that somebody has, by number; at least one, at most four.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct MeshKeys(BTreeMap<KeyId, MeshKey>);

impl MeshKeys {
    /// The first key of a fleet.
    pub fn first(key: MeshKey) -> Self {
        Self(BTreeMap::from([(key.id, key)]))
    }

    /// The key with the greatest number.
    pub fn newest(&self) -> &MeshKey {
        self.0.values().next_back().expect("there is at least one")
    }

    /// Adds a key, replacing one of its number; the oldest goes when there are too many.
    pub fn add(&mut self, key: MeshKey) {
        self.0.insert(key.id, key);
        while self.0.len() > KEYS_MAX {
            self.0.pop_first();
        }
    }

    /// The key of that number.
    pub fn of(&self, id: KeyId) -> Option<&MeshKey> {
        self.0.get(&id)
    }

    /// All of them, the oldest first.
    pub fn iter(&self) -> impl Iterator<Item = &MeshKey> {
        self.0.values()
    }

    /// Reads what [`MeshKeys::to_text`] wrote; `path` names it in errors.
    pub(crate) fn parse(path: &Path, text: &str) -> Result<Self, KeysError> {
        let mut keys = BTreeMap::new();
        for (index, line) in text.lines().enumerate() {
            if line.is_empty() || line.starts_with('#') {
                continue;
            }
            // The line itself is a secret: it must not stand in an error.
            let key = MeshKey::parse(line).ok_or_else(|| KeysError::Malformed {
                file: path.into(),
                found: format!("line {} is no mesh key", index + 1),
                allowed: "a number from 1 to 65535, a space, 64 hexadecimal digits".into(),
            })?;
            keys.insert(key.id, key);
        }
        if keys.is_empty() || keys.len() > KEYS_MAX {
            return Err(KeysError::Malformed {
                file: path.into(),
                found: format!("{} mesh keys", keys.len()),
                allowed: format!("1 to {KEYS_MAX}; `sdr keys add ROBOT` writes the file anew"),
            });
        }
        Ok(Self(keys))
    }

    /// The text of the file: a comment, then one `ID KEY` a line.
    pub fn to_text(&self) -> String {
        let lines = self.0.values().map(|key| key.to_line() + "\n");
        format!("{HEAD}\n{}", lines.collect::<String>())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn key(id: u16) -> MeshKey {
        MeshKey::new(KeyId(id), [u8::try_from(id).unwrap(); 32])
    }

    #[test]
    fn a_file_is_read_back_and_keeps_the_newest_keys() {
        let mut keys = MeshKeys::first(key(1));
        for id in 2..=6 {
            keys.add(key(id));
        }

        let read = MeshKeys::parse(Path::new("mesh.keys"), &keys.to_text()).unwrap();

        assert_eq!(read, keys);
        assert_eq!(read.newest(), &key(6));
        assert_eq!((read.of(KeyId(2)), read.of(KeyId(3))), (None, Some(&key(3))));
    }

    #[test]
    fn a_broken_line_is_named_and_never_shown() {
        let secret = "1 00ff";
        let error = MeshKeys::parse(Path::new("mesh.keys"), &format!("# x\n{secret}\n"));

        let text = error.unwrap_err().to_string();
        assert!(text.starts_with("mesh.keys: line 2 is no mesh key"), "{text}");
        assert!(!text.contains("00ff"), "{text}");
        assert!(MeshKeys::parse(Path::new("mesh.keys"), "").is_err());
        assert_eq!(format!("{:?}", key(7)), "MeshKey(7, ..)");
    }

    #[test]
    fn the_check_tells_keys_apart() {
        assert_ne!(key(1).check(), key(2).check());
        let renamed = MeshKey::new(KeyId(2), *key(1).secret());
        assert_ne!(renamed.check(), key(1).check());
    }
}
