//! The newest mesh key with its papers, from whoever has it to whoever may have it.

use std::fmt;

use serde::{Deserialize, Serialize};
use thiserror::Error;

use crate::{
    mesh_key::{KeyId, MeshKey},
    papers::Papers,
    statement::StatementError,
    trust::Trust,
};

/// A key and what the authority says of it. Over a mutually authenticated stream or a
/// socket of this machine only.
#[derive(Clone, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Delivery {
    /// [`Papers::to_text`].
    papers: String,
    /// [`MeshKey::to_line`].
    key: String,
}

/// What a delivery turned out to be.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Received {
    /// The key that the papers name.
    pub key: MeshKey,
    /// The papers, checked.
    pub papers: Papers,
}

/// Why a delivery is not taken. Whoever sent it is to blame; nothing changed.
#[derive(Clone, Debug, PartialEq, Eq, Error)]
pub enum DeliveryError {
    /// The papers are not this authority's.
    #[error("papers: {0}")]
    Papers(#[from] StatementError),
    /// The key is none, or another than the papers name.
    #[error("the mesh key is not key {0}, which its papers name")]
    Key(KeyId),
}

/// What an agent says to a delivery that it took.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct DeliveryAnswer {
    /// The robot.
    pub robot: String,
    /// The newest mesh key it has now.
    pub newest_key: u16,
    /// How many certificates it denies now.
    pub denied: usize,
    /// Whether any of that is news to it.
    pub changed: bool,
}

impl Delivery {
    /// `key` with its `papers`.
    pub fn new(key: &MeshKey, papers: &Papers) -> Self {
        Self { papers: papers.to_text(), key: key.to_line() }
    }

    /// Checks everything.
    pub fn open(&self, trust: &Trust) -> Result<Received, DeliveryError> {
        let papers = Papers::parse(&self.papers, trust)?;
        let named = papers.notice().notice().key;
        let key = MeshKey::parse(&self.key).filter(|key| papers.name(key));
        let key = key.ok_or(DeliveryError::Key(named))?;
        Ok(Received { key, papers })
    }
}

impl fmt::Debug for Delivery {
    /// Without the key.
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("Delivery").field("papers", &self.papers).finish_non_exhaustive()
    }
}
