//! The two policies of a system, and how they fit together.

use sdr_core::{id::Name, record::FleetValue, spec::PolicyBytes};
use sdr_recovery::{Bar, Level, Trigger};

use super::check::check_size;
use crate::{
    policy::{AllocationFile, Finder, PolicyEntry, PolicyFile, RecoveryFile},
    problem::Mark,
    read::{At, Reader},
};

pub(super) type Named<F> = Option<At<PolicyEntry<F>>>;

pub(super) fn policies(
    allocation: Named<AllocationFile>,
    recovery: Named<RecoveryFile>,
    (finder, system): (&Finder, Option<&At<Name>>),
    reader: &mut Reader,
) -> (PolicyBytes, PolicyBytes) {
    let (name, own) = system.map_or(("system", Mark::FILE), |at| (at.value.as_str(), at.mark));
    let mark = allocation.as_ref().map_or(own, |entry| entry.mark);
    let recovery_mark = recovery.as_ref().map_or(own, |entry| entry.mark);
    let allocation = match allocation {
        Some(entry) => finder.entry(entry, name, reader),
        None => Some(AllocationFile::standard()),
    };
    let recovery = match recovery {
        Some(entry) => finder.entry(entry, name, reader),
        None => Some(RecoveryFile::standard()),
    };
    if let (Some(allocation), Some(recovery)) = (&allocation, &recovery) {
        check_bars(allocation, recovery, mark, reader);
    }
    let allocation = allocation.map(|policy| policy.encode()).unwrap_or_default();
    let recovery = recovery.map(|policy| policy.encode()).unwrap_or_default();
    check_size(
        &FleetValue::Allocation(allocation.clone().into()),
        mark,
        "allocation policy",
        reader,
    );
    check_size(
        &FleetValue::Recovery(recovery.clone().into()),
        recovery_mark,
        "recovery policy",
        reader,
    );
    (allocation, recovery)
}

/// A home that allocation may choose must not be in trouble at once by recovery's bar.
fn check_bars(
    allocation: &sdr_alloc::Policy,
    recovery: &sdr_recovery::Policy,
    mark: Mark,
    reader: &mut Reader,
) {
    let fault = recovery.parts().rules.iter().find_map(|rule| match rule.trigger {
        Trigger::Condition(condition) => match condition.bar {
            Bar::AtMost(Level::Memory(bytes)) => Some(bytes),
            Bar::AtMost(Level::Share(_) | Level::Signal(_) | Level::Time(_)) | Bar::AtLeast(_) => {
                None
            }
        },
        Trigger::Fault => None,
    });
    let (tier, bars) = match &allocation.relaxed {
        Some(relaxed) => ("relaxed", relaxed),
        None => ("first", &allocation.strict),
    };
    if let (Some(fault), Some(home)) = (fault, bars.memory_free_at_least)
        && home <= fault
    {
        let message = format!(
            "allocation `{}` ({tier} tier) fills robots to {home} free, where recovery `{}` sees memory-short (at most {fault})",
            allocation.name,
            recovery.parts().name,
        );
        let help = format!("allowed: memory_free at_least more than {fault}");
        reader.problem(mark, message, Some(help));
    }
}
