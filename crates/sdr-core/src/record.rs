//! What the fleet agrees on: records of the fleet table, merged by greatest version.
//!
//! A system travels as one small record per component and per connection, so that each
//! fits a datagram. A [`SystemRecord`] of some revision is complete once as many component
//! and connection records of that revision are there as it counts.

use alloc::{string::String, sync::Arc, vec::Vec};

use serde::{Deserialize, Serialize};

use crate::{
    fitness::RolePolicy,
    id::{ComponentKey, Name, RobotId},
    order::hash64,
    spec::{ComponentSpec, ConnectionSpec, PolicyBytes},
};

/// Longest value of one record, in bytes, so that a datagram of 1200 carries it.
pub const RECORD_BYTES_MAX: usize = 1000;

/// What a record is about. The number stands on the wire; unknown ones are kept and passed on.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, Deserialize)]
pub struct RecordKind(pub u8);

impl RecordKind {
    /// [`SystemRecord`], keyed by the system.
    pub const SYSTEM: Self = Self(1);
    /// [`ComponentSpec`], keyed `system/component`.
    pub const COMPONENT: Self = Self(2);
    /// [`ConnectionSpec`], keyed `system/index`.
    pub const CONNECTION: Self = Self(3);
    /// Allocation policy ([`PolicyBytes`]), keyed by the system.
    pub const ALLOCATION: Self = Self(4);
    /// Recovery policy ([`PolicyBytes`]), keyed by the system.
    pub const RECOVERY: Self = Self(5);
    /// [`Assignment`], keyed by the component.
    pub const ASSIGNMENT: Self = Self(6);
    /// [`RoleRecord`], keyed by nothing.
    pub const ROLE: Self = Self(7);
    /// [`RolePolicy`], keyed by nothing.
    pub const ROLE_POLICY: Self = Self(10);
    /// [`HorizonRecord`], keyed by nothing.
    pub const HORIZON: Self = Self(15);
}

/// Names one shared fact.
#[derive(Clone, Debug, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, Deserialize)]
pub struct FleetKey {
    /// What it is about.
    pub kind: RecordKind,
    /// Which one, at most 100 bytes.
    pub name: String,
}

/// A system: what belongs to it, and whether it should run at all.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct SystemRecord {
    /// Its name.
    pub name: Name,
    /// Who took it from the operator.
    pub receiver: RobotId,
    /// How many component records of this revision belong to it; none once undeployed.
    pub components: u16,
    /// How many connection records of this revision belong to it.
    pub connections: u16,
    /// Whether it should run; an undeployed system stays as a tombstone.
    pub wanted: bool,
    /// The revision since which it is wanted without a break: homes chosen before are void.
    pub since: u64,
}

/// Where one component should run.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Assignment {
    /// Which component.
    pub component: ComponentKey,
    /// Where the active instance runs.
    pub home: RobotId,
    /// Standbys in order of succession; the home itself stands for one on the same robot.
    pub standbys: Vec<RobotId>,
    /// The home before, which may go on until its consumers have switched (a planned move).
    pub drains: Option<RobotId>,
    /// The deployment's revision this belongs to.
    pub deployment: u64,
    /// Why, in a few words with numbers.
    pub reason: String,
    /// Where it will move: an instance gets ready there and carries no epoch yet.
    pub target: Option<RobotId>,
}

impl Assignment {
    /// Robots beside the home that keep an instance or its place, each once.
    pub fn others(&self) -> impl Iterator<Item = &RobotId> {
        let target = self.target.iter().filter(|target| !self.standbys.contains(target));
        self.standbys.iter().chain(target).filter(|robot| **robot != self.home)
    }

    /// Whether a second instance stands by on the home itself.
    pub fn stands_by_at_home(&self) -> bool {
        self.standbys.contains(&self.home)
    }

    /// Whether `robot` acts on it: as home, standby, target or old home.
    pub fn concerns(&self, robot: &RobotId) -> bool {
        self.home == *robot
            || self.others().any(|other| other == robot)
            || self.drains.as_ref() == Some(robot)
    }
}

/// Who holds the coordinator role; its term and holder are the record's version.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct RoleRecord {
    /// The holder.
    pub holder: RobotId,
    /// Grows with each holder.
    pub term: u64,
    /// The fitness it took the role with, for people.
    pub fitness: u32,
    /// An operator named the holder: only trouble takes the role away, not a fitter robot.
    pub by_operator: bool,
}

/// What was undeployed so long ago that every robot has it on disk, and nobody keeps any more.
///
/// A system not among the survivors, of this revision or an older one, is buried: its records
/// are dropped and refused. Revisions of systems that are deployed anew begin above it.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct HorizonRecord {
    /// The greatest revision of a tombstone that was dropped.
    pub revision: u64,
    /// The greatest number of an epoch that was dropped with one.
    pub epoch: u64,
    /// [`HorizonRecord::word`] of each system that was not undeployed, sorted.
    pub survivors: Vec<u32>,
}

impl HorizonRecord {
    /// Most survivors, so that the record fits a datagram.
    pub const SURVIVORS_MAX: usize = 180;

    /// A system's name as survivors are listed.
    pub fn word(system: &str) -> u32 {
        u32::try_from(hash64(system.as_bytes()) >> 32).unwrap_or(0)
    }

    /// Whether a system of this revision is buried.
    pub fn buries(&self, system: &str, revision: u64) -> bool {
        revision <= self.revision && self.survivors.binary_search(&Self::word(system)).is_err()
    }
}

/// A checked value of the fleet table; parts of systems are shared by all who look at them.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum FleetValue {
    /// A system.
    System(SystemRecord),
    /// A component of a system.
    Component(Arc<ComponentSpec>),
    /// A connection of a system.
    Connection(Arc<ConnectionSpec>),
    /// An allocation policy.
    Allocation(Arc<PolicyBytes>),
    /// A recovery policy.
    Recovery(Arc<PolicyBytes>),
    /// A home.
    Assignment(Assignment),
    /// The role.
    Role(RoleRecord),
    /// How its holder is chosen.
    RolePolicy(RolePolicy),
    /// What is buried.
    Horizon(HorizonRecord),
    /// A kind that this version does not know; kept and passed on.
    Unknown,
}

impl FleetValue {
    /// Reads the bytes of a record of `kind`; bytes behind the known fields are skipped.
    pub fn decode(kind: RecordKind, bytes: &[u8]) -> Result<Self, postcard::Error> {
        fn take<'a, T: Deserialize<'a>>(bytes: &'a [u8]) -> Result<T, postcard::Error> {
            postcard::take_from_bytes(bytes).map(|(value, _later_fields)| value)
        }
        match kind {
            RecordKind::SYSTEM => take(bytes).map(Self::System),
            RecordKind::COMPONENT => take(bytes).map(|value| Self::Component(Arc::new(value))),
            RecordKind::CONNECTION => take(bytes).map(|value| Self::Connection(Arc::new(value))),
            RecordKind::ALLOCATION => take(bytes).map(|value| Self::Allocation(Arc::new(value))),
            RecordKind::RECOVERY => take(bytes).map(|value| Self::Recovery(Arc::new(value))),
            RecordKind::ASSIGNMENT => take(bytes).map(Self::Assignment),
            RecordKind::ROLE => take(bytes).map(Self::Role),
            RecordKind::ROLE_POLICY => take(bytes).map(Self::RolePolicy),
            RecordKind::HORIZON => take(bytes).map(Self::Horizon),
            _ => Ok(Self::Unknown),
        }
    }

    /// The bytes of the record; empty for unknown kinds, whose bytes stand beside it.
    pub fn encode(&self) -> Vec<u8> {
        let bytes = match self {
            Self::System(value) => postcard::to_allocvec(value),
            Self::Component(value) => postcard::to_allocvec(&**value),
            Self::Connection(value) => postcard::to_allocvec(&**value),
            Self::Allocation(value) | Self::Recovery(value) => postcard::to_allocvec(&**value),
            Self::Assignment(value) => postcard::to_allocvec(value),
            Self::Role(value) => postcard::to_allocvec(value),
            Self::RolePolicy(value) => postcard::to_allocvec(value),
            Self::Horizon(value) => postcard::to_allocvec(value),
            Self::Unknown => Ok(Vec::new()),
        };
        bytes.expect("writing plain data to memory cannot fail")
    }
}
