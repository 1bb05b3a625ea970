//! Policies that this robot cannot read: refused from an operator, replaced by the default when
//! another robot, of a later version, took them.

use alloc::{format, string::String};

use super::{Brain, systems::SystemNow};
use crate::{
    recover::Recovery,
    spec::{PolicyBytes, SystemSpec},
};

/// An engine, and why it is not the one that was asked for.
pub(super) type Made = (alloc::boxed::Box<dyn Recovery + Send>, Option<String>);

impl Brain {
    /// What speaks against the policies of a system that an operator gave.
    pub(super) fn objection_to_policies(&self, system: &SystemSpec) -> Option<String> {
        let recovery = (self.seams.recovery)(&system.recovery).err();
        let objection = recovery.or_else(|| (self.seams.allocation)(&system.allocation).err())?;
        Some(format!("{}: {objection}; allowed: a policy of this version", system.name))
    }

    /// The allocation policy of a system, or the default when it cannot be read here: a
    /// component placed by other weights is better than one without a home.
    pub(super) fn readable_allocation(&self, system: &SystemNow) -> PolicyBytes {
        match (self.seams.allocation)(&system.allocation) {
            Ok(()) => (*system.allocation).clone(),
            Err(_) => PolicyBytes::default(),
        }
    }

    /// The recovery engine of a policy, or that of the default when it cannot be read here.
    pub(super) fn readable_recovery(&self, policy: &PolicyBytes) -> Option<Made> {
        match (self.seams.recovery)(policy) {
            Ok(recovery) => Some((recovery, None)),
            Err(error) => {
                let recovery = (self.seams.recovery)(&PolicyBytes::default()).ok()?;
                Some((recovery, Some(error)))
            }
        }
    }
}
