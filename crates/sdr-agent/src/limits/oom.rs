//! Whether a process ended for want of memory, where no group of its own counts that.

use std::cell::Cell;
use std::fs;

/// Words of runtimes that were refused memory, in the last output of a process.
const REFUSED: [&str; 5] = [
    "memory allocation of ",
    "std::bad_alloc",
    "MemoryError",
    "Cannot allocate memory",
    "out of memory",
];

/// The kernel's count of processes it ended for want of memory, on the whole machine.
#[derive(Debug)]
pub(crate) struct OomWatch {
    seen: Cell<u64>,
}

impl OomWatch {
    pub(crate) fn new() -> Self {
        Self { seen: Cell::new(count()) }
    }

    /// Takes note of the present count, once a second, so that an old kill explains nothing.
    pub(crate) fn look(&self) {
        self.seen.set(count());
    }

    /// Whether the kernel ended some process within about the last second.
    pub(crate) fn is_fresh(&self) -> bool {
        count() > self.seen.replace(count())
    }
}

/// Whether a process that was limited said at its end that it was refused memory.
pub(crate) fn says_refused(last_output: &str) -> bool {
    REFUSED.iter().any(|words| last_output.contains(words))
}

fn count() -> u64 {
    parse(&fs::read_to_string("/proc/vmstat").unwrap_or_default())
}

fn parse(vmstat: &str) -> u64 {
    let count = vmstat.lines().find_map(|line| line.strip_prefix("oom_kill "));
    count.and_then(|count| count.trim().parse().ok()).unwrap_or(0)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_count_is_read_and_runtimes_are_understood() {
        assert_eq!(parse("nr_free_pages 1\noom_kill 12\nnuma_hit 3\n"), 12);
        assert_eq!(parse(""), 0);
        assert!(says_refused("x | memory allocation of 4096 bytes failed"));
        assert!(!says_refused("thread 'main' panicked: index out of bounds"));
    }
}
