//! Figures of processes from /proc, read through files that stay open.

use std::collections::{BTreeSet, VecDeque};
use std::fs::{self, File};
use std::io;
use std::os::unix::fs::FileExt as _;
use std::time::Duration;

use sdr_core::time::Instant;

/// CPU is judged over this much time: ticks of the kernel are 10 ms.
const CPU_WINDOW: Duration = Duration::from_secs(1);
/// The proportional share is measured anew at least this often.
const SHARE_PERIOD: Duration = Duration::from_millis(900);
/// Resident memory may change by this much before the share is measured anew.
const SHARE_DRIFT_BYTES: u64 = 8 << 20;
/// A measurement that takes longer is not repeated at each sample.
const SHARE_COST_MAX: Duration = Duration::from_millis(1);

/// One process being watched.
#[derive(Debug)]
pub(super) struct Process {
    pid: u32,
    stat: File,
    statm: File,
    cpu: CpuWindow,
    share: Option<Share>,
    /// Resident memory, bytes.
    pub(super) resident: u64,
}

/// The last measured proportional share.
#[derive(Clone, Copy, Debug)]
struct Share {
    at: Instant,
    pss: u64,
    /// As `statm` counted it at that moment.
    resident: u64,
    cost: Duration,
}

/// Ticks over the last second.
#[derive(Debug, Default)]
struct CpuWindow(VecDeque<(Instant, u64)>);

impl Process {
    /// Opens its files; an error means that it is gone or not ours.
    pub(super) fn open(pid: u32) -> io::Result<Self> {
        let stat = File::open(format!("/proc/{pid}/stat"))?;
        let statm = File::open(format!("/proc/{pid}/statm"))?;
        Ok(Self { pid, stat, statm, cpu: CpuWindow::default(), share: None, resident: 0 })
    }

    /// Looks again; `thorough` measures the proportional share now. An error means it is gone.
    pub(super) fn sample(&mut self, now: Instant, thorough: bool) -> io::Result<()> {
        let ticks = read(&self.stat, parse_ticks)?;
        self.cpu.push(now, ticks);
        self.resident = read(&self.statm, parse_resident)?;
        if thorough || self.share_is_due(now) {
            let begun = crate::clock::now();
            let text = fs::read_to_string(format!("/proc/{}/smaps_rollup", self.pid))?;
            let pss = parse_pss(&text).ok_or(io::ErrorKind::InvalidData)?;
            let cost = crate::clock::now().since(begun);
            self.share = Some(Share { at: now, pss, resident: self.resident, cost });
        }
        Ok(())
    }

    /// Proportional share of memory, bytes. Between measurements it follows resident memory.
    pub(super) fn memory(&self) -> u64 {
        match self.share {
            Some(share) => (share.pss + self.resident).saturating_sub(share.resident),
            None => self.resident,
        }
    }

    /// Thousandths of one core over the last second.
    pub(super) fn cpu_permille(&self) -> u32 {
        self.cpu.permille()
    }

    fn share_is_due(&self, now: Instant) -> bool {
        let Some(share) = self.share else { return true };
        let age = now.since(share.at);
        let drifted = self.resident.abs_diff(share.resident) > SHARE_DRIFT_BYTES;
        // A dear measurement is not repeated while memory is still being touched: the
        // change of resident memory stands for it until the period is over.
        age >= SHARE_PERIOD || (drifted && share.cost <= SHARE_COST_MAX)
    }
}

impl CpuWindow {
    fn push(&mut self, now: Instant, ticks: u64) {
        self.0.push_back((now, ticks));
        while self.0.len() > 2 && now.since(self.0[1].0) >= CPU_WINDOW {
            self.0.pop_front();
        }
    }

    fn permille(&self) -> u32 {
        let (Some((from, first)), Some((to, last))) = (self.0.front(), self.0.back()) else {
            return 0;
        };
        let millis = to.since(*from).as_millis();
        if millis < 100 {
            return 0;
        }
        // One tick is 10 ms: the user's clock rate is 100 on every Linux.
        let busy_us = u128::from(last.saturating_sub(*first)) * 10_000;
        u32::try_from(busy_us / millis).unwrap_or(u32::MAX)
    }
}

/// `root` and all processes below it.
pub(super) fn tree(root: u32) -> BTreeSet<u32> {
    let mut found = BTreeSet::from([root]);
    let mut open = vec![root];
    while let Some(pid) = open.pop() {
        for child in children(pid) {
            if found.insert(child) {
                open.push(child);
            }
        }
    }
    found
}

/// Children of all threads of `pid`; empty when it is gone.
fn children(pid: u32) -> Vec<u32> {
    let Ok(threads) = fs::read_dir(format!("/proc/{pid}/task")) else { return Vec::new() };
    let mut children = Vec::new();
    for thread in threads.flatten() {
        if let Ok(text) = fs::read_to_string(thread.path().join("children")) {
            let pids = text.split_ascii_whitespace().filter_map(|word| word.parse::<u32>().ok());
            children.extend(pids);
        }
    }
    children
}

fn read<T>(file: &File, parse: impl Fn(&str) -> Option<T>) -> io::Result<T> {
    let mut buffer = [0_u8; 1024];
    let length = file.read_at(&mut buffer, 0)?;
    let text = std::str::from_utf8(&buffer[..length]).map_err(io::Error::other)?;
    parse(text).ok_or_else(|| io::ErrorKind::InvalidData.into())
}

/// Fields 14 and 15 of /proc/pid/stat: ticks in user and kernel mode.
fn parse_ticks(text: &str) -> Option<u64> {
    let mut fields = after_name(text)?.skip(11);
    let user: u64 = fields.next()?.parse().ok()?;
    let kernel: u64 = fields.next()?.parse().ok()?;
    Some(user + kernel)
}

/// Field 22 of /proc/pid/stat: when it was started, ticks after boot.
pub(crate) fn parse_start_time(text: &str) -> Option<u64> {
    after_name(text)?.nth(19)?.parse().ok()
}

/// Field 3 and later; the name before them may hold anything, brackets and spaces too.
fn after_name(text: &str) -> Option<std::str::SplitAsciiWhitespace<'_>> {
    Some(text.get(text.rfind(')')? + 1..)?.split_ascii_whitespace())
}

/// Second field of /proc/pid/statm, in bytes.
fn parse_resident(text: &str) -> Option<u64> {
    let pages: u64 = text.split_ascii_whitespace().nth(1)?.parse().ok()?;
    Some(pages * rustix::param::page_size() as u64)
}

/// `Pss:` of smaps_rollup, in bytes.
fn parse_pss(text: &str) -> Option<u64> {
    let line = text.lines().find_map(|line| line.strip_prefix("Pss:"))?;
    let kibi: u64 = line.split_ascii_whitespace().next()?.parse().ok()?;
    Some(kibi * 1024)
}

#[cfg(test)]
mod tests {
    use super::*;

    const STAT: &str = "4711 (a) b (c) S 1 4711 4711 0 -1 4194560 9 8 7 6 250 31 2 1 20 0 3 0 \
                        99887 11223344 567 18446744073709551615 1 1 0 0 0 0 0 0 0 0 0 0 17 0 0 0";
    const ROLLUP: &str = "562f0fe8d000-7ffd97d2d000 ---p 00000000 00:00 0      [rollup]\n\
                          Rss:                1740 kB\nPss:                 303 kB\n\
                          Pss_Dirty:           112 kB\n";

    #[test]
    fn fields_are_counted_behind_a_name_with_brackets() {
        assert_eq!(parse_ticks(STAT), Some(281));
        assert_eq!(parse_start_time(STAT), Some(99887));
        assert_eq!(parse_ticks("4711 (cut"), None);
        assert_eq!(parse_start_time("4711 (short) S 1"), None);
    }

    #[test]
    fn the_share_is_pss_and_not_its_parts() {
        assert_eq!(parse_pss(ROLLUP), Some(303 * 1024));
        assert_eq!(parse_pss("Rss: 1 kB\n"), None);
    }

    #[test]
    fn cpu_is_the_mean_of_the_last_second() {
        let mut window = CpuWindow::default();
        for tenth in 0..40_u64 {
            // Idle for two seconds, then half of a core.
            let ticks = tenth.saturating_sub(20) * 5;
            window.push(Instant::from_millis(tenth * 100), ticks);
        }
        assert_eq!(window.permille(), 500);
    }

    #[test]
    fn memory_that_was_just_touched_is_seen_at_the_next_sample() {
        let mut process = Process::open(std::process::id()).unwrap();
        process.sample(Instant::from_millis(0), true).unwrap();
        let before = process.memory();

        let ballast = vec![1_u8; 64 << 20];
        process.sample(Instant::from_millis(100), false).unwrap();

        assert!(process.memory() > before + (60 << 20), "{} {before}", process.memory());
        assert_eq!(ballast[1 << 20], 1);
    }

    #[test]
    fn the_tree_of_this_process_holds_its_children() {
        let mut child = std::process::Command::new("sleep").arg("1000").spawn().unwrap();

        let found = tree(std::process::id());

        child.kill().unwrap();
        child.wait().unwrap();
        assert!(found.contains(&child.id()));
    }
}
