//! What the machine has and uses, for capacities that robot.toml does not give.

use std::thread;
use std::time::Duration;

use sdr_core::{
    time::Instant,
    units::{Bytes, Permille},
};
use sysinfo::{MemoryRefreshKind, RefreshKind, System};

/// All memory of the machine; `None` when the machine does not say.
pub(crate) fn memory() -> Option<Bytes> {
    let what = RefreshKind::nothing().with_memory(MemoryRefreshKind::nothing().with_ram());
    let system = System::new_with_specifics(what).ok()?;
    Some(Bytes(system.total_memory())).filter(|total| total.0 > 0)
}

/// All cores that this process may use.
pub(crate) fn cpu() -> Permille {
    let cores = thread::available_parallelism().map_or(1, |cores| cores.get());
    Permille(u32::try_from(cores).unwrap_or(u32::MAX / 1000).saturating_mul(1000))
}

/// Time over which the machine's CPU use is measured.
const CPU_WINDOW: Duration = Duration::from_secs(1);

/// What all programs of the machine use, those of others too.
#[derive(Debug)]
pub(super) struct Machine {
    /// `None` on a machine that does not tell.
    system: Option<System>,
    cpu_at: Instant,
}

impl Machine {
    pub(super) fn new(now: Instant) -> Self {
        let mut system = System::new().ok();
        if let Some(system) = &mut system {
            system.refresh_cpu_usage();
        }
        Self { system, cpu_at: now }
    }

    /// What could be had without swapping; `None` when the machine does not say.
    pub(super) fn memory_available(&mut self) -> Option<Bytes> {
        let system = self.system.as_mut()?;
        system.refresh_memory_specifics(MemoryRefreshKind::nothing().with_ram());
        (system.total_memory() > 0).then(|| Bytes(system.available_memory()))
    }

    /// CPU use over the last second; 100% is one core.
    pub(super) fn cpu_used(&mut self, now: Instant) -> Permille {
        let Some(system) = &mut self.system else { return Permille(0) };
        if now.since(self.cpu_at) >= CPU_WINDOW {
            system.refresh_cpu_usage();
            self.cpu_at = now;
        }
        let percent: f32 = system.cpus().iter().map(sysinfo::Cpu::usage).sum();
        #[expect(
            clippy::cast_possible_truncation,
            clippy::cast_sign_loss,
            reason = "per cent of at most some thousand cores; `as` bounds what is not"
        )]
        Permille((percent * 10.0) as u32)
    }
}

/// What counts as used of `capacity`, so that what is left is really there: no more than is
/// free of the capacity, and no more than the machine has available beyond the `reserve`.
pub(super) fn memory_used(
    capacity: Bytes,
    own: Bytes,
    available: Option<Bytes>,
    reserve: Bytes,
) -> Bytes {
    let free = capacity.less(own);
    let free = available.map_or(free, |available| free.min(available.less(reserve)));
    capacity.less(free)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_left_of_the_capacity_is_really_there() {
        let mega = Bytes::mega;
        let used = |available| memory_used(mega(3850), mega(500), available, mega(150));
        // Others took 1 GB: of 4 GB there are 2.5 available, 150 MB of them not for us.
        assert_eq!(used(Some(mega(2500))), mega(1500));
        assert_eq!(used(Some(mega(100))), mega(3850));
        assert_eq!(used(Some(mega(4000))), mega(500));
        assert_eq!(used(None), mega(500));
    }

    #[test]
    fn the_machine_tells_what_it_has_available() {
        let mut machine = Machine::new(crate::clock::now());
        let available = machine.memory_available().unwrap();
        assert!(available.0 > 0 && available < memory().unwrap());
    }

    #[test]
    fn a_program_of_others_that_burns_a_core_is_seen() {
        let mut shell = std::process::Command::new("sh");
        let mut hog = shell.args(["-c", "while :; do :; done"]).spawn().unwrap();
        let mut now = Instant::ZERO;
        let mut machine = Machine::new(now);
        let mut used = Permille(0);
        while used < Permille(200) {
            thread::sleep(Duration::from_millis(300));
            now = now + CPU_WINDOW;
            used = machine.cpu_used(now);
        }
        hog.kill().unwrap();
        hog.wait().unwrap();
    }
}
