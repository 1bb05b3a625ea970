//! What the brains of one process may hold in common.

use alloc::sync::Arc;
use core::fmt;

use super::{
    fact::{Fact, FleetRecord},
    saying::{AuthorKey, Saying},
};

/// One copy of what many brains of one process hold equal: a thousand simulated robots have
/// one fleet table. An agent holds its own alone and needs none.
///
/// What is found must equal what was asked for; nothing else follows from it.
pub trait Commons: fmt::Debug + Send + Sync {
    /// The fact of an equal record, if somebody keeps it.
    fn fact(&self, record: &FleetRecord) -> Option<Arc<Fact>>;

    /// A table holds this fact from now on.
    fn keep_fact(&self, fact: &Arc<Fact>);

    /// An equal record of an author, if somebody keeps it.
    fn saying(&self, key: &AuthorKey, value: &[u8]) -> Option<Arc<Saying>>;

    /// An author's table holds this from now on.
    fn keep_saying(&self, saying: &Arc<Saying>);
}
