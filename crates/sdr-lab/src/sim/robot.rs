//! One robot: a brain, its clock, its disk, its processes.

use std::{collections::BTreeMap, sync::Arc, time::Duration};

use sdr_core::{
    api::StatusView,
    brain::{Brain, BrainConfig, Seams},
    effect::{Direction, Route},
    id::RobotId,
    input::{Finding, InstanceId},
    lifecycle::LifecycleState,
    mesh::Commons,
    order::Token,
    recover::Recovery,
    report::{HostReport, RobotFacts, RolePreference, Usage},
    spec::PolicyBytes,
    time::Instant,
    units::{Bytes, Permille},
};

use super::{
    air::{FRAME_BYTES, address},
    clock::Clock,
    disk::Disk,
    pool::Pool,
    process::{Behaviour, Process},
};

/// What makes the recovery of a policy; the error is for people.
pub type MakeRecovery = fn(&PolicyBytes) -> Result<Box<dyn Recovery + Send>, String>;

/// Memory that the agent itself takes.
const AGENT_MEMORY: Bytes = Bytes::mega(12);

/// One robot of the simulated fleet.
pub struct Robot {
    /// Its name.
    pub id: RobotId,
    /// What it measures, before its processes are added.
    pub host: HostReport,
    /// Its body and limits.
    pub facts: RobotFacts,
    /// What each of its processes takes; what it declared when `None`.
    pub takes: Option<Usage>,
    /// How processes of a component (by name) behave here; as usual when absent.
    pub behaviours: BTreeMap<String, Behaviour>,
    /// What its operator's programs answer; `None`: there are none.
    pub says: Option<Vec<Finding>>,
    /// What makes its recovery of a policy, from its next start on.
    pub recovery: MakeRecovery,
    /// Starts of processes so far.
    pub launches: usize,
    pub(crate) number: usize,
    /// Starts of the agent so far; what was due for an earlier one is dropped.
    pub(crate) life: u64,
    pub(crate) on_since: Instant,
    /// When it lost power last; before its first start nobody counts on it.
    pub(crate) off_since: Option<Instant>,
    pub(crate) brain: Option<Box<Brain>>,
    pub(crate) clock: Clock,
    pub(crate) drift_ppm: i64,
    pub(crate) disk: Disk,
    pub(crate) processes: BTreeMap<InstanceId, Process>,
    pub(crate) outs: BTreeMap<String, Option<Token>>,
    pub(crate) ins: BTreeMap<String, ()>,
    pub(crate) wake_at: Option<Instant>,
    pub(crate) paused_at: Instant,
    pub(crate) paused_until: Instant,
    /// Datagrams in the socket's buffer while the loop stands still.
    pub(crate) backlog: usize,
    /// Loses power in the middle of its next write, for so long.
    pub(crate) crash_at_store: Option<Duration>,
    /// It does not come back.
    pub(crate) is_lost: bool,
    /// Most effects of one `handle` so far.
    pub(crate) effects_max: usize,
    /// Longest datagram so far.
    pub(crate) datagram_bytes_max: usize,
}

impl Robot {
    pub(crate) fn new(number: usize, facts: RobotFacts, drift_ppm: i64) -> Self {
        Self {
            id: RobotId::new(&format!("robot-{}", number + 1)).expect("a number makes a name"),
            host: HostReport { memory_used: AGENT_MEMORY, ..HostReport::default() },
            facts,
            takes: None,
            behaviours: BTreeMap::new(),
            says: None,
            recovery: sdr_recovery::make,
            launches: 0,
            number,
            life: 0,
            on_since: Instant::ZERO,
            off_since: Some(Instant::ZERO),
            brain: None,
            clock: Clock::new(Instant::ZERO, Instant::ZERO, drift_ppm),
            drift_ppm,
            disk: Disk::new(),
            processes: BTreeMap::new(),
            outs: BTreeMap::new(),
            ins: BTreeMap::new(),
            wake_at: None,
            paused_at: Instant::ZERO,
            paused_until: Instant::ZERO,
            backlog: 0,
            crash_at_store: None,
            is_lost: false,
            effects_max: 0,
            datagram_bytes_max: 0,
        }
    }

    /// Starts the agent from what is on its disk, its clock showing `shown`.
    pub(crate) fn start(
        &mut self,
        now: Instant,
        shown: Instant,
        robots: usize,
        commons: &Arc<Pool>,
    ) {
        self.life += 1;
        self.on_since = now;
        self.clock = Clock::new(now, shown, self.drift_ppm);
        self.paused_until = now;
        self.backlog = 0;
        self.wake_at = None;
        let config = BrainConfig {
            seeds: (0..robots).map(address).collect(),
            listen: Some(address(self.number)),
            seed: (self.life << 40) ^ (self.number as u64) << 33,
            ..BrainConfig::new(self.id.clone(), self.facts.clone())
        };
        let commons: Arc<dyn Commons> = commons.clone();
        let seams = Seams {
            recovery: Box::new(self.recovery),
            allocation: Box::new(sdr_alloc::check),
            commons: Some(commons),
        };
        self.brain = Some(Brain::new(config, seams, self.disk.held().cloned(), shown));
    }

    /// Power is gone: agent, processes, routes.
    pub(crate) fn stop(&mut self, now: Instant) -> BTreeMap<InstanceId, Process> {
        self.brain = None;
        self.off_since = Some(now);
        self.life += 1;
        self.outs.clear();
        self.ins.clear();
        self.crash_at_store = None;
        std::mem::take(&mut self.processes)
    }

    /// Its agent is gone, and the routes between robots with it.
    pub(crate) fn leave_processes(&mut self) {
        self.brain = None;
        self.life += 1;
        self.outs.clear();
        self.ins.clear();
        self.crash_at_store = None;
    }

    /// Whether its agent runs.
    pub fn is_on(&self) -> bool {
        self.brain.is_some()
    }

    /// Its brain, while it is on.
    pub fn brain(&self) -> Option<&Brain> {
        self.brain.as_deref()
    }

    /// What it believes at the virtual moment `now`; `None` while it is off.
    pub fn status(&self, now: Instant) -> Option<StatusView> {
        self.brain.as_ref().map(|brain| brain.status(self.clock.show(now)))
    }

    /// Whom it believes to hold the coordinator role, and under which term.
    pub fn coordinator(&self) -> Option<(&RobotId, u64)> {
        let role = self.brain.as_ref()?.mesh().fleet().role()?;
        Some((&role.holder, role.term))
    }

    /// Whether it believes that it is the coordinator itself.
    pub fn is_coordinator(&self) -> bool {
        self.coordinator().is_some_and(|(holder, _)| *holder == self.id)
    }

    /// Whether it decides for others now.
    pub fn coordinates(&self) -> bool {
        self.brain.as_ref().is_some_and(|brain| brain.coordinates())
    }

    /// Starts and ends of its agent so far: names one life of it.
    pub fn life(&self) -> u64 {
        self.life
    }

    /// When its agent started last.
    pub fn on_since(&self) -> Instant {
        self.on_since
    }

    /// Most effects of one input so far.
    pub fn effects_max(&self) -> usize {
        self.effects_max
    }

    /// Bytes of guard beats since its start, headers and seal included.
    pub fn guard_bytes(&self) -> u64 {
        let traffic = self.brain.as_ref().map(|brain| brain.mesh().traffic()).unwrap_or_default();
        traffic.guard_bytes + traffic.guard * FRAME_BYTES as u64
    }

    /// Bytes sent since its start, by section of the mesh's datagrams, before the seal.
    pub fn section_bytes(&self) -> [u64; sdr_core::mesh::SECTION_NAMES.len()] {
        self.brain.as_ref().map(|brain| brain.mesh().traffic().sections).unwrap_or_default()
    }

    /// Longest datagram so far, bytes.
    pub fn datagram_bytes_max(&self) -> usize {
        self.datagram_bytes_max
    }

    /// Its processes.
    pub fn processes(&self) -> impl Iterator<Item = (&InstanceId, &Process)> {
        self.processes.iter()
    }

    /// Its processes of a component: those that act, else all.
    pub(crate) fn instances_of(&self, word: &str) -> Vec<InstanceId> {
        let of = || self.processes.iter().filter(|(_, p)| p.component.name.as_str() == word);
        let acting: Vec<InstanceId> =
            of().filter(|(_, p)| p.token.is_some()).map(|(id, _)| *id).collect();
        if acting.is_empty() { of().map(|(id, _)| *id).collect() } else { acting }
    }

    /// What it measures of itself now.
    pub(crate) fn measured(&self) -> HostReport {
        let memory = self.processes.values().map(|process| self.usage(process).memory.0).sum();
        let cpu = self.processes.values().map(|process| self.usage(process).cpu.0).sum();
        HostReport {
            memory_used: self.host.memory_used.plus(Bytes(memory)),
            cpu_used: self.host.cpu_used.plus(Permille(cpu)),
            ..self.host
        }
    }

    /// What one of its processes takes.
    pub(crate) fn usage(&self, process: &Process) -> Usage {
        let declared = Usage { memory: process.spec.needs.memory, cpu: process.spec.needs.cpu };
        self.takes.unwrap_or(declared)
    }

    /// Whether its disk refuses what is written from now on.
    pub fn fill_disk(&mut self, full: bool) {
        self.disk.full = full;
    }

    /// Forgets everything on disk.
    pub fn wipe_disk(&mut self) {
        self.disk.wipe();
    }

    /// Takes the wanted routes; the paths that changed.
    pub(crate) fn take_routes(&mut self, routes: &[Route]) -> Vec<String> {
        let (mut outs, mut ins) = (BTreeMap::new(), BTreeMap::new());
        for route in routes {
            match &route.direction {
                Direction::Out { active } => {
                    outs.insert(route.path.clone(), active.clone());
                }
                Direction::In => {
                    ins.insert(route.path.clone(), ());
                }
            }
        }
        let mut changed: Vec<String> = outs
            .iter()
            .filter(|(path, token)| self.outs.get(*path) != Some(token))
            .map(|(path, _)| path.clone())
            .collect();
        changed.extend(ins.keys().filter(|path| !self.ins.contains_key(*path)).cloned());
        (self.outs, self.ins) = (outs, ins);
        changed
    }

    /// Whether samples of a port (`system/component/port`) leave this robot; `None` when it is
    /// not even connected to others.
    pub fn sends(&self, path: &str) -> Option<bool> {
        self.outs.get(path).map(Option::is_some)
    }

    /// Whether a process of this component is active here.
    pub fn has_active(&self, word: &str) -> bool {
        self.processes.values().any(|process| {
            process.component.name.as_str() == word && process.state == LifecycleState::Active
        })
    }
}

/// A body that can launch `words`.
pub(crate) fn body(memory: Bytes, cpu: Permille, words: &[&str]) -> RobotFacts {
    let mut launchables: Vec<u32> =
        words.iter().map(|word| sdr_core::spec::launch_hash(word)).collect();
    launchables.sort_unstable();
    RobotFacts {
        memory_capacity: memory,
        cpu_capacity: cpu,
        labels: Vec::new(),
        devices: Vec::new(),
        launchables,
        role: RolePreference::Able,
        api: String::new(),
        version: "simulated".into(),
    }
}
