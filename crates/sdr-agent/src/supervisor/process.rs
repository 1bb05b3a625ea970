//! One running process: its end, its signals, its last words.

use std::io;
use std::path::PathBuf;
use std::process::{Child, ExitStatus};

use rustix::fd::OwnedFd;
use rustix::process::{Pid, PidfdFlags, Signal, kill_process_group, pidfd_open};
use sdr_core::effect::LaunchOrder;
use tokio::io::Interest;
use tokio::io::unix::AsyncFd;

use super::launch::{self, LaunchError, Launched};
use super::{SupervisorConfig, logs};

/// Lines of output that stand in the reason of an end.
const LAST_LINES: usize = 5;

/// A child of the agent, leader of its own process group.
#[derive(Debug)]
pub(super) struct Process {
    child: Child,
    pid: Pid,
    exit: AsyncFd<OwnedFd>,
    pub(super) executable: PathBuf,
    log: PathBuf,
    log_begin: u64,
}

impl Process {
    /// Starts what `order` says; a process whose end could not be seen is not kept.
    pub(super) fn start(
        config: &SupervisorConfig,
        order: &LaunchOrder,
    ) -> Result<Self, LaunchError> {
        let Launched { mut child, executable, log, log_begin } = launch::start(config, order)?;
        let pid = Pid::from_child(&child);
        match watch(pid) {
            Ok(exit) => Ok(Self { child, pid, exit, executable, log, log_begin }),
            Err(error) => {
                child.kill().and_then(|()| child.wait()).map_err(LaunchError::Watch)?;
                Err(LaunchError::Watch(error))
            }
        }
    }

    /// Its number.
    pub(super) fn id(&self) -> u32 {
        self.child.id()
    }

    /// Returns when it has ended; it is not reaped by that.
    pub(super) async fn ended(&self) {
        let ready = self.exit.readable().await;
        ready.expect("the reactor lives as long as its tasks").retain_ready();
    }

    /// To its whole group: a component's children end with it.
    pub(super) fn signal(&self, signal: Signal) {
        match kill_process_group(self.pid, signal) {
            Ok(()) | Err(rustix::io::Errno::SRCH) => {}
            Err(error) => {
                tracing::error!(event = "not-signalled", pid = ?self.pid, ?signal, %error);
            }
        }
    }

    /// Ends what is left of its group, reaps it, and says how it ended.
    pub(super) fn reap(&mut self) -> String {
        // Before it is reaped: until then its number, and that of its group, are its own.
        self.signal(Signal::KILL);
        let how = match self.child.wait() {
            Ok(status) => describe(status),
            Err(error) => format!("ended, status unknown: {error}"),
        };
        match logs::lines_at_end(&self.log, self.log_begin, LAST_LINES) {
            Ok((lines, _)) if !lines.trim().is_empty() => {
                format!("{how}; last output: {}", lines.trim().replace('\n', " | "))
            }
            Ok(_) | Err(_) => how,
        }
    }
}

#[expect(unsafe_code, reason = "tokio cannot know that a descriptor stays the same; here it does")]
fn watch(pid: Pid) -> io::Result<AsyncFd<OwnedFd>> {
    let handle = pidfd_open(pid, PidfdFlags::empty())?;
    // SAFETY: an `OwnedFd` names one open descriptor as long as it lives, and it lives in the
    // `AsyncFd`, which takes it out of the reactor before it is closed.
    Ok(unsafe { AsyncFd::register_with_interest(handle, Interest::READABLE) }?)
}

fn describe(status: ExitStatus) -> String {
    use std::os::unix::process::ExitStatusExt as _;
    match (status.code(), status.signal()) {
        (Some(code), _) => format!("exit status {code}"),
        (None, Some(number)) => match signal_name(number) {
            Some(name) => format!("killed by signal {number} ({name})"),
            None => format!("killed by signal {number}"),
        },
        (None, None) => format!("{status}"),
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
    use std::os::unix::process::ExitStatusExt as _;

    use super::*;

    #[test]
    fn an_end_by_a_signal_is_told_by_its_usual_name() {
        assert_eq!(describe(ExitStatus::from_raw(9)), "killed by signal 9 (SIGKILL)");
        assert_eq!(describe(ExitStatus::from_raw(34)), "killed by signal 34");
        assert_eq!(describe(ExitStatus::from_raw(7 << 8)), "exit status 7");
    }
}
