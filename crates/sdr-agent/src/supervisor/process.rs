//! One running process: its end, its signals, its last words.

use std::io;
use std::path::PathBuf;
use std::process::Child;
use std::time::Duration;

use rustix::fd::OwnedFd;
use rustix::process::{Pid, PidfdFlags, Signal, kill_process_group, pidfd_open};
use sdr_core::effect::LaunchOrder;
use tokio::io::Interest;
use tokio::io::unix::AsyncFd;

use super::keepsake::Keepsake;
use super::launch::{self, LaunchError, Launched};
use super::pidfd::{self, End};
use super::survivors::Survivor;
use super::{SupervisorConfig, logs};
use crate::limits::Limiter;

/// Lines of output that stand in the reason of an end.
const LAST_LINES: usize = 5;

/// The end of a process that another one reaped, on a kernel that does not tell.
const UNKNOWN: &str = "ended; an agent before this one started it, so its exit status is unknown";
/// How often the end of a process that is not our child is asked for ...
const ASKS_MAX: u32 = 10;
/// ... and how long its parent has between two times to reap it.
const ASK_AGAIN_AFTER: Duration = Duration::from_millis(2);

/// A process of a component, leader of its own group.
#[derive(Debug)]
pub(super) struct Process {
    parent: Parent,
    pid: Pid,
    exit: AsyncFd<OwnedFd>,
    pub(super) executable: PathBuf,
    pub(super) keepsake: Keepsake,
}

/// Who started it.
#[derive(Debug)]
enum Parent {
    /// This agent; it reaps it.
    Us(Child),
    /// An agent before this one, or this one before it was upgraded.
    Predecessor,
}

impl Process {
    /// Starts what `order` says; a process whose end could not be seen is not kept.
    pub(super) fn start(
        (config, limiter): (&SupervisorConfig, &Limiter),
        order: &LaunchOrder,
    ) -> Result<Self, LaunchError> {
        let Launched { mut child, executable, place } = launch::start(config, limiter, order)?;
        let pid = Pid::from_child(&child);
        let watched = pidfd_open(pid, PidfdFlags::empty()).map_err(io::Error::from).and_then(watch);
        match watched {
            Ok(exit) => {
                let keepsake = Keepsake::new(order, place);
                Ok(Self { parent: Parent::Us(child), pid, exit, executable, keepsake })
            }
            Err(error) => {
                child.kill().and_then(|()| child.wait()).map_err(LaunchError::Watch)?;
                Err(LaunchError::Watch(error))
            }
        }
    }

    /// Goes on with one that outlived the agent before.
    pub(super) fn adopt(survivor: Survivor) -> io::Result<(LaunchOrder, Self)> {
        let Survivor { order, keepsake, held, executable } = survivor;
        let (pid, exit) = (held.pid, watch(held.handle)?);
        Ok((order, Self { parent: Parent::Predecessor, pid, exit, executable, keepsake }))
    }

    /// Its number.
    pub(super) fn id(&self) -> u32 {
        self.pid.as_raw_nonzero().get().unsigned_abs()
    }

    /// Returns when it has ended; it is not reaped by that.
    pub(super) async fn ended(&self) {
        let ready = self.exit.readable().await;
        ready.expect("the reactor lives as long as its tasks").retain_ready();
    }

    /// To its whole group: a component's children end with it.
    pub(super) fn signal(&self, signal: Signal) {
        let done = match self.parent {
            // Until it is reaped its number, and that of its group, are its own.
            Parent::Us(_) => kill_process_group(self.pid, signal).map_err(io::Error::from),
            Parent::Predecessor => pidfd::signal_group(self.exit.get_ref(), self.pid, signal),
        };
        match done {
            Ok(()) => {}
            Err(error) if error.raw_os_error() == Some(libc::ESRCH) => {}
            Err(error) => {
                tracing::error!(event = "not-signalled", pid = ?self.pid, ?signal, %error);
            }
        }
    }

    /// Ends what is left of its group, reaps it, and says how it ended: when that is known, and
    /// in words, with its last output.
    pub(super) async fn reap(&mut self) -> (Option<End>, String) {
        self.signal(Signal::KILL);
        let end = match &mut self.parent {
            Parent::Us(child) => child.wait().ok().and_then(End::of),
            Parent::Predecessor => self.end_by_others().await,
        };
        (end, self.with_last_words(end.map_or_else(|| UNKNOWN.into(), describe)))
    }

    fn with_last_words(&self, how: String) -> String {
        match logs::lines_at_end(&self.keepsake.log, self.keepsake.log_begin, LAST_LINES) {
            Ok((lines, _)) if !lines.trim().is_empty() => {
                format!("{how}; last output: {}", lines.trim().replace('\n', " | "))
            }
            Ok(_) | Err(_) => how,
        }
    }

    /// Somebody else reaps it; the kernel tells us how it ended once that is done.
    async fn end_by_others(&self) -> Option<End> {
        for _ in 0..ASKS_MAX {
            let end = pidfd::end(self.exit.get_ref());
            if end.is_some() {
                return end;
            }
            tokio::time::sleep(ASK_AGAIN_AFTER).await;
        }
        None
    }
}

#[expect(unsafe_code, reason = "tokio cannot know that a descriptor stays the same; here it does")]
fn watch(handle: OwnedFd) -> io::Result<AsyncFd<OwnedFd>> {
    // SAFETY: an `OwnedFd` names one open descriptor as long as it lives, and it lives in the
    // `AsyncFd`, which takes it out of the reactor before it is closed.
    Ok(unsafe { AsyncFd::register_with_interest(handle, Interest::READABLE) }?)
}

fn describe(end: End) -> String {
    match end {
        End::Status(code) => format!("exit status {code}"),
        End::Signal(number) => killed_by(number),
    }
}

fn killed_by(number: i32) -> String {
    match signal_name(number) {
        Some(name) => format!("killed by signal {number} ({name})"),
        None => format!("killed by signal {number}"),
    }
}

/// Those that end a process, as signal(7) numbers them on x86 and ARM.
fn signal_name(number: i32) -> Option<&'static str> {
    Some(match number {
        1 => "SIGHUP",
        2 => "SIGINT",
        3 => "SIGQUIT",
        4 => "SIGILL",
        5 => "SIGTRAP",
        6 => "SIGABRT",
        7 => "SIGBUS",
        8 => "SIGFPE",
        9 => "SIGKILL",
        10 => "SIGUSR1",
        11 => "SIGSEGV",
        12 => "SIGUSR2",
        13 => "SIGPIPE",
        14 => "SIGALRM",
        15 => "SIGTERM",
        24 => "SIGXCPU",
        25 => "SIGXFSZ",
        31 => "SIGSYS",
        _ => return None,
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_end_by_a_signal_is_told_by_its_usual_name() {
        assert_eq!(describe(End::Signal(9)), "killed by signal 9 (SIGKILL)");
        assert_eq!(describe(End::Signal(34)), "killed by signal 34");
        assert_eq!(describe(End::Status(7)), "exit status 7");
    }
}
