//! One look at all processes of the robot's tree.

use std::collections::{BTreeMap, BTreeSet};
use std::io;
use std::time::Duration;

use sdr_core::{
    input::InstanceId,
    report::Usage,
    time::Instant,
    units::{Bytes, Permille},
};

use super::process::{self, Process};
use super::watch::Round;

/// Time between two looks for new grandchildren.
const TREE_PERIOD: Duration = Duration::from_secs(1);
/// A change of an instance's memory that is told at once.
const MOVED_BYTES: u64 = 4 << 20;

/// What one look found.
#[derive(Debug, Default)]
pub(super) struct Sample {
    /// Of the agent and all below it.
    pub(super) memory: Bytes,
    /// Of the agent and all below it.
    pub(super) cpu: Permille,
    /// Of each instance with all below it.
    pub(super) usage: Vec<(InstanceId, Usage)>,
    /// Whether an instance's memory changed much since it was last told.
    pub(super) moved: bool,
    /// The agent alone, proportional share.
    pub(super) agent_memory: Bytes,
    /// The agent alone, resident.
    pub(super) agent_resident: Bytes,
    /// The agent alone.
    pub(super) agent_cpu: Permille,
}

/// Keeps the files of all processes open between looks.
#[derive(Debug)]
pub(super) struct Sampler {
    agent_pid: u32,
    agent: Process,
    /// Processes of each instance, its root first.
    trees: BTreeMap<InstanceId, BTreeMap<u32, Process>>,
    told: BTreeMap<InstanceId, u64>,
    tree_at: Instant,
}

impl Sampler {
    pub(super) fn new() -> io::Result<Self> {
        let agent_pid = std::process::id();
        Ok(Self {
            agent_pid,
            agent: Process::open(agent_pid)?,
            trees: BTreeMap::new(),
            told: BTreeMap::new(),
            tree_at: Instant::ZERO,
        })
    }

    pub(super) fn sample(&mut self, now: Instant, round: &Round) -> Sample {
        self.trees.retain(|instance, _| round.roots.contains_key(instance));
        self.told.retain(|instance, _| round.roots.contains_key(instance));
        let look_for_children = now >= self.tree_at;
        if look_for_children {
            self.tree_at = now + TREE_PERIOD;
        }
        for (instance, root) in &round.roots {
            let fresh = !self.trees.contains_key(instance);
            let processes = self.trees.entry(*instance).or_default();
            if fresh || look_for_children {
                adopt(processes, process::tree(*root));
            }
        }
        let mut sample = self.sample_agent(now);
        for (instance, processes) in &mut self.trees {
            let thorough = round.changed.contains(instance);
            processes.retain(|_, process| process.sample(now, thorough).is_ok());
            let usage = usage(processes);
            let told = self.told.entry(*instance).or_default();
            if told.abs_diff(usage.memory.0) > MOVED_BYTES {
                *told = usage.memory.0;
                sample.moved = true;
            }
            sample.memory = sample.memory.plus(usage.memory);
            sample.cpu = sample.cpu.plus(usage.cpu);
            sample.usage.push((*instance, usage));
        }
        sample
    }

    fn sample_agent(&mut self, now: Instant) -> Sample {
        if let Err(error) = self.agent.sample(now, false) {
            tracing::debug!(event = "own-figures-unread", pid = self.agent_pid, %error);
        }
        let memory = Bytes(self.agent.memory());
        let cpu = Permille(self.agent.cpu_permille());
        Sample {
            memory,
            cpu,
            agent_memory: memory,
            agent_cpu: cpu,
            agent_resident: Bytes(self.agent.resident),
            ..Sample::default()
        }
    }
}

/// Opens those that are new, forgets those that are gone.
fn adopt(processes: &mut BTreeMap<u32, Process>, found: BTreeSet<u32>) {
    processes.retain(|pid, _| found.contains(pid));
    for pid in found {
        if !processes.contains_key(&pid)
            && let Ok(process) = Process::open(pid)
        {
            processes.insert(pid, process);
        }
    }
}

fn usage(processes: &BTreeMap<u32, Process>) -> Usage {
    processes.values().fold(Usage::default(), |sum, process| Usage {
        memory: sum.memory.plus(Bytes(process.memory())),
        cpu: sum.cpu.plus(Permille(process.cpu_permille())),
    })
}
