//! What the machine has, for capacities that robot.toml does not give.

use std::thread;

use sdr_core::units::{Bytes, Permille};
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
