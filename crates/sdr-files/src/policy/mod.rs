//! The two policies of a system, and the fleet's policy of the coordinator role: where they
//! are found, and what they say.
//!
//! A name is looked up as `policies/<kind>/<name>.yaml` in the folder of the file that names
//! it, in the folder above, beside the file itself (for `extends`), and among the built-in
//! ones; words with a `/` or ending in `.yaml` are paths from that folder.

mod allocation;
mod allocation_file;
mod bar;
mod bars;
mod cause_words;
mod condition_words;
mod conditions;
mod find;
mod recovery;
mod recovery_file;
mod role;
mod role_file;
mod role_text;

use std::path::Path;

use sdr_alloc::Policy as AllocationPolicy;
use sdr_core::fitness::RolePolicy;
use sdr_recovery::Policy as RecoveryPolicy;

pub(crate) use allocation_file::AllocationFile;
pub(crate) use find::{Finder, PolicyEntry, PolicyFile};
pub(crate) use recovery::own_rules;
pub(crate) use recovery_file::RecoveryFile;
pub(crate) use role_file::RoleFile;
pub use role_text::role_text;

use crate::problem::{Problems, Source};

/// Reads and checks the allocation policy at `path`, with those it extends.
pub fn load_allocation(path: &Path) -> Result<AllocationPolicy, Problems> {
    find::load::<AllocationFile>(Source::load(path)?, &Finder::beside(path))
}

/// Reads and checks the recovery policy at `path`, with those it extends.
pub fn load_recovery(path: &Path) -> Result<RecoveryPolicy, Problems> {
    find::load::<RecoveryFile>(Source::load(path)?, &Finder::beside(path))
}

/// Reads and checks the policy of the coordinator role at `path`, with those it extends.
pub fn load_role(path: &Path) -> Result<RolePolicy, Problems> {
    find::load::<RoleFile>(Source::load(path)?, &Finder::beside(path))
}

/// As [`load_allocation`] for a text; `file` names it in problems, others are looked up from
/// `folder`.
pub fn parse_allocation(
    file: &str,
    text: &str,
    folder: &Path,
) -> Result<AllocationPolicy, Problems> {
    find::load::<AllocationFile>(Source::new(file, text), &Finder::from(folder))
}

/// As [`load_recovery`] for a text.
pub fn parse_recovery(file: &str, text: &str, folder: &Path) -> Result<RecoveryPolicy, Problems> {
    find::load::<RecoveryFile>(Source::new(file, text), &Finder::from(folder))
}

/// As [`load_role`] for a text.
pub fn parse_role(file: &str, text: &str, folder: &Path) -> Result<RolePolicy, Problems> {
    find::load::<RoleFile>(Source::new(file, text), &Finder::from(folder))
}

#[cfg(test)]
mod tests;
