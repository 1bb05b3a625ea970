//! What a predecessor left running: adopted when it is known for certain, else ended.
//!
//! A number alone means nothing: a process is the one of the journal when boot, start time,
//! executable and the badge in its environment agree, and is held by a pidfd from before the
//! comparison on.

use std::fs;
use std::io;
use std::path::Path;
use std::time::Duration;

use rustix::event::{PollFd, PollFlags, Timespec, poll};
use rustix::fd::OwnedFd;
use rustix::process::{Pid, PidfdFlags, Signal, getpgid, pidfd_open};
use sdr_component::protocol::ENV_BADGE;
use sdr_core::{effect::LaunchOrder, event::Event, spec::OnAgentDeath};

use super::journal::{self, Entry, Left};
use super::keepsake::Keepsake;
use super::{SupervisorConfig, pidfd};
use crate::clock;
use crate::events::Events;

/// From SIGTERM to SIGKILL.
const GRACE: Duration = Duration::from_secs(1);

/// A process that goes on under this agent.
#[derive(Debug)]
pub(crate) struct Survivor {
    pub(super) order: LaunchOrder,
    pub(super) keepsake: Keepsake,
    pub(super) held: Held,
    pub(super) executable: std::path::PathBuf,
}

/// A process that cannot be taken for another any more.
#[derive(Debug)]
pub(super) struct Held {
    pub(super) pid: Pid,
    pub(super) handle: OwnedFd,
}

/// A process that is to end.
struct Leftover {
    entry: Entry,
    held: Held,
    why: &'static str,
}

/// Those of the journal that go on. The others of it are told and ended: at once, in at most
/// [`GRACE`] and the kernel's time to free their memory, when none goes on; beside the start
/// when some do.
pub(crate) fn find(config: &SupervisorConfig, events: &Events) -> Vec<Survivor> {
    let boot_id = journal::boot_id();
    let mut survivors = Vec::new();
    let mut leftovers = Vec::new();
    let Left { entries, trouble } = journal::read(&config.state);
    if let Some(trouble) = trouble {
        tracing::error!(event = "processes-corrupt", %trouble);
        let said =
            format!("{trouble}; what runs and is not in it is told to finish when it greets");
        events.publish(events.new_event("processes-corrupt", said));
    }
    for entry in entries {
        // What another boot started ended with it.
        if entry.boot_id != boot_id {
            continue;
        }
        let Some(held) = same_process(&entry) else {
            events.publish(ended_unwatched(events, &entry));
            continue;
        };
        match known(config, &entry, held.pid) {
            Ok((order, keepsake)) => {
                let executable = entry.executable;
                survivors.push(Survivor { order, keepsake, held, executable });
            }
            Err(why) => leftovers.push(Leftover { entry, held, why }),
        }
    }
    if survivors.is_empty() || leftovers.is_empty() {
        end(leftovers, events);
    } else {
        let events = events.clone();
        std::thread::spawn(move || end(leftovers, &events));
    }
    survivors
}

/// What is needed to go on with it, or why this agent must not.
fn known(
    config: &SupervisorConfig,
    entry: &Entry,
    pid: Pid,
) -> Result<(LaunchOrder, Keepsake), &'static str> {
    const OLD: &str = "another version of the agent started it";
    let keepsake: Keepsake = serde_json::from_value(entry.keepsake.clone()).map_err(|_| OLD)?;
    let order = keepsake.order(entry.instance).ok_or(OLD)?;
    if config.on_agent_death_of(&order.spec) == OnAgentDeath::Stop {
        return Err("it is to end with its agent");
    }
    if keepsake.socket != config.socket || keepsake.memory != config.memory {
        return Err("robot.toml names other places than it knows");
    }
    if !carries(pid, &keepsake.badge) {
        return Err("it does not carry the badge of the journal");
    }
    if getpgid(Some(pid)) != Ok(pid) {
        return Err("it leads no group of its own");
    }
    Ok((order, keepsake))
}

/// A handle to the process when it is the one of the journal. The start time is compared
/// after the handle was opened, so its number cannot have been given to another meanwhile.
fn same_process(entry: &Entry) -> Option<Held> {
    let pid = Pid::from_raw(i32::try_from(entry.pid).ok()?)?;
    let handle = pidfd_open(pid, PidfdFlags::empty()).ok()?;
    let same_start = journal::start_time(entry.pid) == Some(entry.start_time);
    (same_start && runs(entry) && !pidfd::has_ended(&handle)).then_some(Held { pid, handle })
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

/// Whether the environment it was started with has this badge.
fn carries(pid: Pid, badge: &str) -> bool {
    let environment = fs::read(format!("/proc/{}/environ", pid.as_raw_nonzero()));
    let wanted = format!("{ENV_BADGE}={badge}");
    let environment = environment.unwrap_or_default();
    environment.split(|byte| *byte == 0).any(|variable| variable == wanted.as_bytes())
}

/// Ends them all at once, and says so.
fn end(leftovers: Vec<Leftover>, events: &Events) {
    for Leftover { held, .. } in &leftovers {
        signal(held, Signal::TERM);
    }
    let deadline = clock::now() + GRACE;
    for Leftover { entry, held, why } in leftovers {
        let in_peace = wait(&held.handle, deadline.since(clock::now()));
        // Its children, too.
        signal(&held, Signal::KILL);
        let gone = in_peace || wait(&held.handle, GRACE);
        events.publish(leftover_ended(events, &entry, gone, why));
    }
}

fn signal(held: &Held, signal: Signal) {
    match pidfd::signal_group(&held.handle, held.pid, signal) {
        Ok(()) => {}
        Err(error) if error.raw_os_error() == Some(libc::ESRCH) => {}
        Err(error) => tracing::warn!(event = "leftover-unsignalled", pid = ?held.pid, %error),
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

fn leftover_ended(events: &Events, entry: &Entry, gone: bool, why: &str) -> Event {
    let end = if gone { "ended" } else { "could not be ended" };
    let (pid, component) = (entry.pid, &entry.component);
    let reason = format!("process {pid} of {component} outlived its agent: {end}, {why}");
    events.new_event("leftover-ended", reason).number("pid", f64::from(entry.pid))
}

fn ended_unwatched(events: &Events, entry: &Entry) -> Event {
    let (pid, component) = (entry.pid, &entry.component);
    let reason =
        format!("process {pid} of {component} ended while no agent was there; exit status unknown");
    events.new_event("ended-unwatched", reason).number("pid", f64::from(pid))
}
