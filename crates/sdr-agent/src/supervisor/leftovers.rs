//! Ends what a predecessor that was killed left running: what its journal names, and, as its
//! disk may be lost, what was started with this agent's socket.

use std::fs;
use std::io;
use std::path::Path;
use std::time::Duration;

use rustix::event::{PollFd, PollFlags, Timespec, poll};
use rustix::fd::OwnedFd;
use rustix::process::{Pid, PidfdFlags, Signal, getpgid, kill_process_group, pidfd_open};
use sdr_core::event::Event;

use sdr_component::protocol::{ENV_COMPONENT, ENV_INSTANCE, ENV_SOCKET};

use super::journal::{self, Entry};
use crate::clock;
use crate::events::Events;

/// From SIGTERM to SIGKILL.
const GRACE: Duration = Duration::from_secs(1);

/// Ends the processes of the journal in `state` that are still the same ones, and those that
/// were told to speak at `socket`, all at once, and says so. Blocks for at most [`GRACE`] and
/// the kernel's time to free their memory.
pub(crate) fn end_leftovers(state: &Path, socket: &Path, events: &Events) {
    let boot_id = journal::boot_id();
    let mut entries = journal::read(state);
    let listed: Vec<u32> = entries.iter().map(|entry| entry.pid).collect();
    entries.extend(unlisted(socket, &boot_id).filter(|entry| !listed.contains(&entry.pid)));
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

/// Leaders of groups whose environment names `socket`: only an agent of this robot starts such.
fn unlisted(socket: &Path, boot_id: &str) -> impl Iterator<Item = Entry> {
    let processes = fs::read_dir("/proc").into_iter().flatten().flatten();
    processes.filter_map(move |process| {
        let pid: u32 = process.file_name().to_str()?.parse().ok()?;
        let leader = getpgid(Pid::from_raw(i32::try_from(pid).ok()?)).ok()?;
        // Of another user it cannot be read, and is none of ours.
        let environment = fs::read(process.path().join("environ")).ok()?;
        let value = |name: &str| {
            let mut words = environment.split(|byte| *byte == 0);
            words.find_map(|word| word.strip_prefix(name.as_bytes())?.strip_prefix(b"="))
        };
        let ours = value(ENV_SOCKET)? == socket.as_os_str().as_encoded_bytes();
        let leads = u32::try_from(leader.as_raw_nonzero().get()) == Ok(pid);
        (ours && leads).then_some(())?;
        let text = |name| value(name).map(|word| String::from_utf8_lossy(word).into_owned());
        Some(Entry {
            component: text(ENV_COMPONENT).unwrap_or_default(),
            instance: text(ENV_INSTANCE).and_then(|word| word.parse().ok()).unwrap_or_default(),
            pid,
            start_time: journal::start_time(pid)?,
            boot_id: boot_id.into(),
            executable: fs::read_link(process.path().join("exe")).ok()?,
        })
    })
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
