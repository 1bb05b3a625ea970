//! The mesh keys of a robot with the papers that name the newest.

use std::path::Path;

use crate::{
    delivery::{Delivery, Received},
    folder::{KeysError, make_private, read_secret, read_text, write_private},
    mesh_key::{KeyId, MeshKeys},
    papers::Papers,
    trust::Trust,
};

/// Mesh keys, in folders of robots and of the authority.
pub(crate) const MESH_KEYS: &str = "mesh.keys";
/// Signed statements, in all folders.
pub(crate) const NOTICES: &str = "notices";

/// What a robot knows of mesh keys; the papers always name the newest key.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Keyset {
    keys: MeshKeys,
    papers: Papers,
}

impl Keyset {
    /// Reads `mesh.keys` and `notices` in `folder`.
    pub fn load(folder: &Path, trust: &Trust) -> Result<Self, KeysError> {
        let file = folder.join(MESH_KEYS);
        let keys = MeshKeys::parse(&file, &read_secret(&file)?)?;
        let notices = folder.join(NOTICES);
        let papers =
            Papers::parse(&read_text(&notices)?, trust).map_err(|error| KeysError::Malformed {
                file: notices.clone(),
                found: error.to_string(),
                allowed: format!("what the authority of fleet {} signed", trust.fleet()),
            })?;
        match papers.name(keys.newest()) {
            true => Ok(Self { keys, papers }),
            false => Err(KeysError::Mismatch {
                file,
                found: format!(
                    "its newest key is not key {}, which {} names",
                    papers.notice().notice().key,
                    notices.display()
                ),
                next: "copy the whole folder that `sdr keys add` made".into(),
            }),
        }
    }

    /// As [`Keyset::load`]; `None` when nothing was saved there yet.
    pub fn load_saved(folder: &Path, trust: &Trust) -> Result<Option<Self>, KeysError> {
        match folder.join(NOTICES).exists() {
            true => Self::load(folder, trust).map(Some),
            false => Ok(None),
        }
    }

    /// Writes both files into `folder`, which is made for its user alone when it is not there.
    pub fn save(&self, folder: &Path) -> Result<(), KeysError> {
        make_private(folder)?;
        write_private(&folder.join(MESH_KEYS), &self.keys.to_text())?;
        write_private(&folder.join(NOTICES), &self.papers.to_text())
    }

    /// Takes a newer key with its papers; whether it is newer.
    pub fn take(&mut self, received: Received) -> bool {
        let newer = received.key.id() > self.newest();
        if newer {
            self.keys.add(received.key);
            self.papers = received.papers;
        }
        newer
    }

    /// The newest key's number.
    pub fn newest(&self) -> KeyId {
        self.keys.newest().id()
    }

    /// The keys.
    pub fn keys(&self) -> &MeshKeys {
        &self.keys
    }

    /// What the authority said.
    pub fn papers(&self) -> &Papers {
        &self.papers
    }

    /// For another robot.
    pub fn delivery(&self) -> Delivery {
        Delivery::new(self.keys.newest(), &self.papers)
    }
}
