//! `limits` of a component: what its process may take.

use sdr_core::{
    spec::Limits,
    units::{Bytes, Permille},
};

use crate::read::{At, Reader, table};

/// Least memory that a process can start with.
const MEMORY_MIN: Bytes = Bytes::mega(4);
/// Most cores of one list.
const CORES_MAX: usize = 64;

table! {
    /// What the process of a component may take.
    pub(crate) struct LimitsTable {
        /// Memory; more of it ends the process.
        memory: Option<At<Bytes>>,
        /// CPU, 100% is one core; more of it is waited for. Needs cgroup v2.
        cpu: Option<At<Permille>>,
        /// Processes and threads. Needs cgroup v2.
        pids: Option<At<u32>>,
        /// Niceness, -20 (first) to 19 (last).
        nice: Option<At<i8>>,
        /// Scheduling class; default: shared fairly.
        scheduling: Option<SchedulingTable>,
        /// Only on these cores, from 0.
        cores: Option<At<Vec<u16>>>,
        /// Its memory stays in RAM.
        lock_memory: Option<At<bool>>,
    }
}

table! {
    /// A scheduling class.
    pub(crate) struct SchedulingTable {
        /// SCHED_FIFO at this priority, 1 to 99.
        fifo: At<u8>,
    }
}

pub(super) fn limits(table: LimitsTable, reader: &mut Reader) -> Limits {
    let fifo = table.scheduling.map(|scheduling| scheduling.fifo);
    let mut check = |given: Option<(crate::problem::Mark, String)>, allowed: &str| {
        if let Some((mark, found)) = given {
            reader.problem(mark, found, Some(format!("allowed: {allowed}")));
        }
    };
    let small = table.memory.as_ref().filter(|at| at.value < MEMORY_MIN);
    check(
        small.map(|at| (at.mark, format!("{} is too little to start", at.value))),
        "at least 4MB",
    );
    let none = table.cpu.as_ref().filter(|at| at.value.0 < 10);
    check(none.map(|at| (at.mark, "less than 1% of a core".into())), "at least 1%");
    let none = table.pids.as_ref().filter(|at| at.value == 0);
    check(none.map(|at| (at.mark, "no process at all".into())), "at least 1");
    let far = table.nice.as_ref().filter(|at| !(-20..=19).contains(&at.value));
    check(far.map(|at| (at.mark, format!("niceness {}", at.value))), "-20 to 19");
    let far = fifo.as_ref().filter(|at| !(1..=99).contains(&at.value));
    check(far.map(|at| (at.mark, format!("priority {}", at.value))), "1 to 99");
    let odd = table.cores.as_ref().filter(|at| at.value.is_empty() || at.value.len() > CORES_MAX);
    check(odd.map(|at| (at.mark, format!("{} cores", at.value.len()))), "1 to 64 cores");
    Limits {
        memory: table.memory.map(|at| at.value),
        cpu: table.cpu.map(|at| at.value),
        pids: table.pids.map(|at| at.value),
        nice: table.nice.map(|at| at.value),
        fifo: fifo.map(|at| at.value),
        cores: table.cores.map(|at| at.value).unwrap_or_default(),
        lock_memory: table.lock_memory.is_some_and(|at| at.value),
    }
}
