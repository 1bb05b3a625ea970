//! Defects planted on purpose: each is one that somebody could write, and the simulator's
//! checkers must catch it. Compiled only with the feature `planted`, which nothing but the
//! test of the checkers asks for; without it `is` is `false` and costs nothing.

/// One defect. Its switch stands where the rule is kept.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[repr(u8)]
pub enum Defect {
    /// A home goes on under its old epoch when a greater one lives elsewhere.
    NoEpochCheck = 1,
    /// Numbers are sent before they are on disk.
    WireBeforeDisk,
    /// The role is not written to disk.
    TermNotStored,
    /// The next home gets the same epoch again.
    EpochNotRaised,
    /// Runs begin anew with each start of the agent.
    RunNotReserved,
    /// Any version of a record replaces any other.
    NoVersionOrder,
    /// An undeployed system is forgotten at once instead of staying as a tombstone.
    TombstoneDropped,
    /// A home that is gone is left as it is.
    GoneIgnored,
    /// The role is not taken over from a holder that is gone.
    RoleNeverTaken,
    /// Everybody who sees the role free takes it, the fittest or not.
    RoleTakenByAll,
    /// What the fleet agreed on is pushed once and never repaired by gossip.
    NoRepair,
    /// A component that nobody wants any more goes on.
    UnwantedGoesOn,
    /// A process that ended is not started again.
    NoRestart,
    /// After a restart nothing that was deployed is remembered.
    SystemNotStored,
    /// Anything heard after a silence begins all components anew.
    RestartedByHeal,
    /// News of others is passed on to everybody, again and again.
    EndlessEcho,
    /// The old home of a planned move never ends.
    DrainForever,
    /// A process of an old edition of its component goes on.
    OldEditionRuns,
    /// What robots say of themselves is never updated.
    StaleReports,
    /// Homes are not written to disk.
    HomesNotStored,
    /// Samples of the home are not forwarded to other robots.
    SilentRoute,
    /// A standby follows a silent home without asking anybody.
    NoWitness,
    /// A standby sends epochs that it never reserved on disk.
    EpochNotReserved,
    /// A robot that lost its disk goes on with numbers it may have made before.
    ForgottenReused,
    /// A home that nobody hears goes on with what must not act alone.
    LeaseNeverEnds,
    /// A successor is chosen before the lease of the home is over.
    LeaseNotAwaited,
    /// Tombstones are dropped before everybody has them on disk.
    BuriedTooSoon,
}

impl Defect {
    /// All that must be caught.
    pub const ALL: [Self; 27] = [
        Self::NoEpochCheck,
        Self::WireBeforeDisk,
        Self::TermNotStored,
        Self::EpochNotRaised,
        Self::RunNotReserved,
        Self::NoVersionOrder,
        Self::TombstoneDropped,
        Self::GoneIgnored,
        Self::RoleNeverTaken,
        Self::RoleTakenByAll,
        Self::NoRepair,
        Self::UnwantedGoesOn,
        Self::NoRestart,
        Self::SystemNotStored,
        Self::RestartedByHeal,
        Self::EndlessEcho,
        Self::DrainForever,
        Self::OldEditionRuns,
        Self::StaleReports,
        Self::HomesNotStored,
        Self::SilentRoute,
        Self::ForgottenReused,
        Self::LeaseNeverEnds,
        Self::LeaseNotAwaited,
        Self::NoWitness,
        Self::EpochNotReserved,
        Self::BuriedTooSoon,
    ];
}

#[cfg(feature = "planted")]
static CHOSEN: core::sync::atomic::AtomicU8 = core::sync::atomic::AtomicU8::new(0);

/// Plants one defect in every brain of this process, or takes it out.
#[cfg(feature = "planted")]
pub fn plant(defect: Option<Defect>) {
    let number = defect.map_or(0, |defect| defect as u8);
    CHOSEN.store(number, core::sync::atomic::Ordering::SeqCst);
}

/// Whether this defect is planted now.
#[cfg(feature = "planted")]
pub(crate) fn is(defect: Defect) -> bool {
    CHOSEN.load(core::sync::atomic::Ordering::Relaxed) == defect as u8
}

/// No defect is planted in a build without the feature.
#[cfg(not(feature = "planted"))]
pub(crate) const fn is(_defect: Defect) -> bool {
    false
}
