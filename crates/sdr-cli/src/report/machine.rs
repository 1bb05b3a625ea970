//! The machine a run took place on: this run's Table IV.

use std::fs;

use serde::{Deserialize, Serialize};

/// What the machine is; `None` where it does not say.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(default)]
pub(crate) struct Machine {
    /// Board or processor.
    pub(crate) model: Option<String>,
    /// Cores that may be used.
    pub(crate) cores: Option<u32>,
    /// Memory in all, bytes.
    pub(crate) memory_bytes: Option<u64>,
    /// Kernel.
    pub(crate) kernel: Option<String>,
    /// Transparent huge pages: `always`, `madvise` or `never`.
    pub(crate) huge_pages: Option<String>,
    /// Version of `sdr`.
    pub(crate) sdr: Option<String>,
    /// `release` or `debug`.
    pub(crate) build: Option<String>,
    /// Compiler, when the build knew it.
    pub(crate) rustc: Option<String>,
    /// Commit, when the build knew it.
    pub(crate) commit: Option<String>,
}

impl Machine {
    /// This machine, now.
    pub(crate) fn here() -> Self {
        let release = fs::read_to_string("/proc/sys/kernel/osrelease").ok();
        let kernel =
            release.map(|release| format!("Linux {} {}", release.trim(), std::env::consts::ARCH));
        let cores = std::thread::available_parallelism().ok();
        let board = fs::read_to_string("/proc/device-tree/model").ok();
        Self {
            model: board.map(|text| text.trim_end_matches('\0').to_owned()).or_else(processor),
            cores: cores.and_then(|count| u32::try_from(count.get()).ok()),
            memory_bytes: memory_of("MemTotal:"),
            kernel,
            huge_pages: huge_pages(),
            sdr: Some(env!("CARGO_PKG_VERSION").to_owned()),
            build: Some(if cfg!(debug_assertions) { "debug" } else { "release" }.to_owned()),
            rustc: option_env!("SDR_RUSTC").map(str::to_owned),
            commit: option_env!("SDR_COMMIT").map(str::to_owned),
        }
    }

    /// A sentence for a build that does not know what it was made of.
    pub(crate) fn unknown(&self) -> Option<String> {
        let known = [("commit", &self.commit), ("rustc", &self.rustc)];
        let missing: Vec<_> =
            known.iter().filter(|(_, value)| value.is_none()).map(|(word, _)| *word).collect();
        (!missing.is_empty()).then(|| {
            format!("{} of this build unknown: demo.sh builds with them", missing.join(" and "))
        })
    }
}

/// Memory that new work can have without swapping, bytes.
pub(crate) fn memory_available() -> Option<u64> {
    memory_of("MemAvailable:")
}

fn memory_of(key: &str) -> Option<u64> {
    parse_memory(&fs::read_to_string("/proc/meminfo").ok()?, key)
}

/// One line of /proc/meminfo in bytes.
fn parse_memory(text: &str, key: &str) -> Option<u64> {
    let line = text.lines().find_map(|line| line.strip_prefix(key))?;
    let kibibytes: u64 = line.trim().strip_suffix("kB")?.trim().parse().ok()?;
    kibibytes.checked_mul(1024)
}

fn processor() -> Option<String> {
    let text = fs::read_to_string("/proc/cpuinfo").ok()?;
    let value = |key: &str| {
        let line = text.lines().find(|line| line.starts_with(key))?;
        line.split_once(':').map(|(_, value)| value.trim().to_owned())
    };
    value("model name").or_else(|| value("Model")).or_else(|| value("CPU implementer"))
}

/// The word in brackets of the kernel's switch.
fn huge_pages() -> Option<String> {
    let text = fs::read_to_string("/sys/kernel/mm/transparent_hugepage/enabled").ok()?;
    let (_, rest) = text.split_once('[')?;
    rest.split_once(']').map(|(word, _)| word.to_owned())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn memory_is_read_in_bytes_and_nonsense_is_unknown() {
        let text = "MemTotal:       16384 kB\nMemAvailable:      10 kB\nHuge: x kB\nOdd: 3\n";
        assert_eq!(parse_memory(text, "MemTotal:"), Some(16_777_216));
        assert_eq!(parse_memory(text, "MemAvailable:"), Some(10_240));
        assert_eq!(parse_memory(text, "Huge:"), None);
        assert_eq!(parse_memory(text, "Odd:"), None);
        assert_eq!(parse_memory(text, "Absent:"), None);
    }

    #[test]
    fn this_machine_has_cores_memory_and_a_kernel() {
        let here = Machine::here();
        assert!(here.cores.is_some_and(|cores| cores > 0));
        assert!(here.memory_bytes.is_some() && here.kernel.is_some());
    }
}
