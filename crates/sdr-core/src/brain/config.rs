//! What a brain is given at its start.

use alloc::{boxed::Box, string::String, sync::Arc, vec::Vec};
use core::{fmt, net::SocketAddr, time::Duration};

use crate::{
    blob::PART_BYTES_MAX,
    fitness::RolePolicy,
    id::RobotId,
    mesh::{Commons, MeshConfig},
    order::hash64,
    recover::Recovery,
    report::RobotFacts,
    spec::PolicyBytes,
};

/// Who the robot is and how patient it is.
#[derive(Clone, Debug, PartialEq)]
pub struct BrainConfig {
    /// Its name.
    pub robot: RobotId,
    /// Its fleet; datagrams of other fleets are dropped.
    pub fleet: String,
    /// Its body and limits.
    pub facts: RobotFacts,
    /// Where other robots listen: seeds from robot.toml.
    pub seeds: Vec<SocketAddr>,
    /// Where whoever is on the local network listens, when others are looked for; unlike a
    /// seed it does not say that there are others.
    pub group: Option<SocketAddr>,
    /// Where others reach this robot, when it knows.
    pub listen: Option<SocketAddr>,
    /// From the operating system's randomness: incarnation nonce and seed.
    pub seed: u64,
    /// Time between two rounds of gossip; default 350 ms.
    pub gossip_period: Duration,
    /// Age of the last fresh news at which a robot counts as gone; default 11.5 s.
    pub gone_after: Duration,
    /// How long after the start to wait for a peer before activating what is remembered;
    /// default 2 s.
    pub rejoin_wait: Duration,
    /// How long an old home may go on in a planned move; default 1 s.
    pub drain_max: Duration,
    /// How the holder of the coordinator role is chosen, until the fleet has a policy of its own.
    pub role_policy: RolePolicy,
    /// Longest part of a system; less than a blob's where blobs cannot travel.
    pub part_bytes_max: usize,
    /// How long the target of a move may take to get ready; default 30 s.
    pub prepare_max: Duration,
}

impl BrainConfig {
    /// The defaults for robot `robot` with `facts`.
    pub fn new(robot: RobotId, facts: RobotFacts) -> Self {
        Self {
            robot,
            fleet: String::from("fleet"),
            facts,
            seeds: Vec::new(),
            group: None,
            listen: None,
            seed: 0,
            gossip_period: Duration::from_millis(350),
            gone_after: Duration::from_millis(11_500),
            rejoin_wait: Duration::from_secs(2),
            drain_max: Duration::from_secs(1),
            role_policy: RolePolicy::default(),
            part_bytes_max: PART_BYTES_MAX,
            prepare_max: Duration::from_secs(30),
        }
    }
}

impl BrainConfig {
    /// What concerns the mesh.
    pub(super) fn of_mesh(&self) -> MeshConfig {
        MeshConfig {
            robot: self.robot.clone(),
            fleet: u32::try_from(hash64(self.fleet.as_bytes()) & 0xffff_ffff).unwrap_or(0),
            seeds: self.seeds.clone(),
            group: self.group,
            listen: self.listen,
            period: self.gossip_period,
            gone_after: self.gone_after,
        }
    }

    /// How many addresses to begin with are not this robot's own; `remembered` are those that
    /// others were heard from before.
    pub(super) fn seeds_of_others(&self, remembered: &[SocketAddr]) -> usize {
        let seeds = self.seeds.iter().filter(|seed| Some(**seed) != self.listen).count();
        // who is found has no seeds: what it remembers is all that says that there are others
        if self.group.is_some() { seeds.max(remembered.len()) } else { seeds }
    }
}

/// Makes a recovery engine from a policy; the error is for people.
pub type MakeRecovery =
    Box<dyn Fn(&PolicyBytes) -> Result<Box<dyn Recovery + Send>, String> + Send>;

/// Whether an allocation policy can be read here; the error is for people.
pub type CheckAllocation = Box<dyn Fn(&PolicyBytes) -> Result<(), String> + Send>;

/// What other crates fill in.
pub struct Seams {
    /// Makes the recovery engine of a system from its policy.
    pub recovery: MakeRecovery,
    /// Reads the allocation policy of a system.
    pub allocation: CheckAllocation,
    /// What several brains in one process hold in common; `None` for one that is alone.
    pub commons: Option<Arc<dyn Commons>>,
}

impl fmt::Debug for Seams {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("Seams")
    }
}
