//! The two policies of a system, and how they fit together.

use sdr_alloc::Bars;
use sdr_core::{id::Name, record::FleetValue, spec::PolicyBytes};
use sdr_recovery::{Bar, Condition, Fact, Level};

use super::check::check_size;
use crate::{
    policy::{AllocationFile, Finder, PolicyEntry, PolicyFile, RecoveryFile, own_rules},
    problem::Mark,
    read::{At, Reader},
};

pub(super) type Named<F> = Option<At<PolicyEntry<F>>>;

/// A component and its own rules as they are written.
pub(super) type OwnRules = (String, At<PolicyEntry<RecoveryFile>>);

/// What a system says of its policies.
type Given = (Named<AllocationFile>, Named<RecoveryFile>, Vec<OwnRules>);

pub(super) fn policies(
    (allocation, recovery, own): Given,
    (finder, system): (&Finder, Option<&At<Name>>),
    reader: &mut Reader,
) -> (PolicyBytes, PolicyBytes) {
    let (name, system_mark) =
        system.map_or(("system", Mark::FILE), |at| (at.value.as_str(), at.mark));
    let mark = allocation.as_ref().map_or(system_mark, |entry| entry.mark);
    let recovery_mark = recovery.as_ref().map_or(system_mark, |entry| entry.mark);
    let allocation = match allocation {
        Some(entry) => finder.entry(entry, name, reader),
        None => Some(AllocationFile::standard()),
    };
    let mut recovery = match recovery {
        Some(entry) => finder.entry(entry, name, reader),
        None => Some(RecoveryFile::standard()),
    };
    for (component, entry) in own {
        if let Some(recovery) = &mut recovery {
            own_rules(recovery, &component, entry, finder, reader);
        }
    }
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

/// A home that allocation may choose must not be in trouble at once by recovery's bar: not by
/// the strict tier at the start, and not by the relaxed one in trouble, or moves would chase
/// each other.
fn check_bars(
    allocation: &sdr_alloc::Policy,
    recovery: &sdr_recovery::Policy,
    mark: Mark,
    reader: &mut Reader,
) {
    let conditions = || {
        let rules = recovery.parts().rules.iter();
        rules.filter_map(|rule| Some((rule.cause, rule.trigger.condition()?)))
    };
    let relaxed = allocation.relaxed.as_ref().map(|bars| ("relaxed", bars));
    for (tier, bars) in [("first", &allocation.strict)].into_iter().chain(relaxed) {
        for (cause, condition) in conditions() {
            let Some((key, home, allowed)) = meets(bars, &condition) else { continue };
            let message = format!(
                "allocation `{}` ({tier} tier) takes robots with {home}, where recovery `{}` sees {cause}",
                allocation.name,
                recovery.parts().name,
            );
            reader.problem(mark, message, Some(format!("allowed: {key} {allowed}")));
        }
    }
}

/// The bar of a tier that is at recovery's own or beyond it: its key, what it takes, and what
/// is allowed.
fn meets(bars: &Bars, condition: &Condition) -> Option<(&'static str, String, String)> {
    let more = |fault: String| format!("at_least more than {fault}");
    let less = |fault: String| format!("at_most less than {fault}");
    match (condition.fact, condition.bar) {
        (Fact::RobotMemoryFree, Bar::AtMost(Level::Memory(fault))) => {
            let home = bars.memory_free_at_least.filter(|home| *home <= fault)?;
            Some(("memory_free", format!("{home} free"), more(fault.to_string())))
        }
        (Fact::RobotBattery, Bar::AtMost(Level::Share(fault))) => {
            let home = bars.battery_at_least?.at_least;
            let found = ("battery", format!("a charge of {home}"), more(fault.to_string()));
            (home <= fault).then_some(found)
        }
        (Fact::RobotCpu, Bar::AtLeast(Level::Share(fault))) => {
            let home = bars.cpu_used_at_most.filter(|home| *home >= fault)?;
            Some(("cpu_used", format!("{home} of their CPU used"), less(fault.to_string())))
        }
        (Fact::RobotRssi, Bar::AtMost(Level::Signal(fault))) => {
            let home = bars.rssi_at_least.filter(|home| *home <= fault)?;
            Some(("rssi", format!("a level of {home}"), more(fault.to_string())))
        }
        (_, Bar::AtMost(_) | Bar::AtLeast(_)) => None,
    }
}
