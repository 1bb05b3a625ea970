//! Whether the machine has room for the demo, asked before anything starts.

use std::fs;

use crate::{failure::Failure, report::machine::memory_available};

/// Seven times 500 MB while two components move (the old ones end when the new ones are heard),
/// and 200 MB for agents and programs.
const WITH_BALLAST_BYTES: u64 = 3_700_000_000;
/// Agents, components and the world.
const WITHOUT_BALLAST_BYTES: u64 = 400_000_000;

/// Refuses with wrong usage when there is too little memory.
pub(super) fn check(ballast: bool) -> Result<(), Failure> {
    let free = match (memory_available(), left_of_group()) {
        (Some(machine), Some(group)) => Some(machine.min(group)),
        (machine, group) => machine.or(group),
    };
    judge(ballast, free).map_err(Failure::Usage)
}

/// A machine that does not say what is free is trusted.
fn judge(ballast: bool, free: Option<u64>) -> Result<(), String> {
    let needed = if ballast { WITH_BALLAST_BYTES } else { WITHOUT_BALLAST_BYTES };
    let Some(free) = free.filter(|free| *free < needed) else { return Ok(()) };
    let offer = match ballast {
        true => "\n  Try: sdr demo --no-ballast        (components touch no 500 MB)",
        false => "\n  Close something, or take a larger machine.",
    };
    Err(format!(
        "three robots, five components, one fading radio (about 30 s)\n  \
         needs {} of memory for a moment; this machine has {} free.{offer}",
        gigabytes(needed),
        gigabytes(free)
    ))
}

/// What our control group may still have; `None` when it has no bound.
fn left_of_group() -> Option<u64> {
    let number = |path: &str| fs::read_to_string(path).ok()?.trim().parse::<u64>().ok();
    let most = number("/sys/fs/cgroup/memory.max")?;
    Some(most.saturating_sub(number("/sys/fs/cgroup/memory.current").unwrap_or(0)))
}

/// `3.7 GB`.
fn gigabytes(bytes: u64) -> String {
    format!("{}.{} GB", bytes / 1_000_000_000, bytes / 100_000_000 % 10)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn too_little_memory_is_told_with_both_numbers_and_a_way_out() {
        let text = judge(true, Some(2_190_000_000)).unwrap_err();
        for part in ["needs 3.7 GB", "has 2.1 GB free", "sdr demo --no-ballast"] {
            assert!(text.contains(part), "{text}");
        }
        assert!(!judge(false, Some(100_000_000)).unwrap_err().contains("--no-ballast"));
    }

    #[test]
    fn enough_is_enough() {
        assert_eq!(judge(true, Some(3_700_000_000)), Ok(()));
        assert_eq!(judge(false, Some(2_190_000_000)), Ok(()));
        assert_eq!(judge(true, None), Ok(()));
    }
}
