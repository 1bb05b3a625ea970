//! Ends what a predecessor that was killed left running.

use std::fs;
use std::io;
use std::path::Path;
use std::time::Duration;

use rustix::event::{PollFd, PollFlags, Timespec, poll};
use rustix::fd::OwnedFd;
use rustix::process::{Pid, PidfdFlags, Signal, kill_process_group, pidfd_open};
use sdr_core::event::Event;

use super::journal::{self, Entry};
use crate::clock;
use crate::events::Events;

/// From SIGTERM to SIGKILL.
const GRACE: Duration = Duration::from_secs(1);

/// Ends the processes of the journal in `state` that are still the same ones, all at once,
/// and says so. Blocks for at most [`GRACE`] and the kernel's time to free their memory.
pub(crate) fn end_leftovers(state: &Path, events: &Events) {
    let boot_id = journal::boot_id();
    let entries = journal::read(state);
    let mut running: Vec<(Entry, Pid, OwnedFd)> = Vec::new();
    for entry in entries {
        if let Some((pid, handle)) = same_process(&entry, &boot_id) {
            signal(pid, Signal::TERM);
            running.push((entry, pid, handle));
        }
    }
    let deadline = clock::now() + GRACE;
    for (entry, pid, handle) in running {
        let in_peace = wait(&handle, deadline.since(clock::now()));
        // Its children, too: they share its group, whose number stays taken while one lives.
        signal(pid, Signal::KILL);
        let gone = in_peace || wait(&handle, GRACE);
        events.publish(event(events, &entry, gone));
    }
}

/// A handle to the process when it is the one of the journal. The start time is compared
/// after the handle was opened, so its number cannot have been given to another meanwhile.
fn same_process(entry: &Entry, boot_id: &str) -> Option<(Pid, OwnedFd)> {
    if entry.boot_id != boot_id {
        return None;
    }
    let pid = Pid::from_raw(i32::try_from(entry.pid).ok()?)?;
    let handle = pidfd_open(pid, PidfdFlags::empty()).ok()?;
    let same_start = journal::start_time(entry.pid) == Some(entry.start_time);
    (same_start && runs(entry)).then_some((pid, handle))
}

/// Whether it still runs the executable of the journal: itself or, for a script, as an
/// argument of its interpreter.
fn runs(entry: &Entry) -> bool {
    let program = fs::read_link(format!("/proc/{}/exe", entry.pid)).unwrap_or_default();
    let program = program.to_string_lossy();
    // A rebuilt executable leaves the old one without a name.
    let program = Path::new(program.trim_end_matches(" (deleted)"));
    let wanted = fs::canonicalize(&entry.executable).unwrap_or_else(|_| entry.executable.clone());
    if program == wanted || program == entry.executable {
        return true;
    }
    let arguments = fs::read(format!("/proc/{}/cmdline", entry.pid)).unwrap_or_default();
    let wanted = entry.executable.as_os_str().as_encoded_bytes();
    arguments.split(|byte| *byte == 0).take(3).any(|argument| argument == wanted)
}

fn signal(group: Pid, signal: Signal) {
    match kill_process_group(group, signal) {
        Ok(()) | Err(rustix::io::Errno::SRCH) => {}
        Err(error) => tracing::warn!(event = "leftover-unsignalled", ?group, %error),
    }
}

/// Whether the process ended within `patience`.
fn wait(handle: &OwnedFd, patience: Duration) -> bool {
    let deadline = clock::now() + patience;
    loop {
        let left = Timespec::try_from(deadline.since(clock::now())).ok();
        match poll(&mut [PollFd::new(handle, PollFlags::IN)], left.as_ref()) {
            Ok(0) => return false,
            Ok(_) => return true,
            Err(rustix::io::Errno::INTR) => {}
            Err(error) => {
                tracing::warn!(event = "leftover-unwatched", error = %io::Error::from(error));
                return false;
            }
        }
    }
}

fn event(events: &Events, entry: &Entry, gone: bool) -> Event {
    let end = if gone { "ended" } else { "could not be ended" };
    let reason = format!("process {} of {} outlived its agent: {end}", entry.pid, entry.component);
    events.new_event("leftover-ended", reason).number("pid", f64::from(entry.pid))
}
