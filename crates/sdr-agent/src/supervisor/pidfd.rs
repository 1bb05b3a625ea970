//! Handles to processes that need not be our children: what rustix does not offer yet.

use std::io;
use std::mem::size_of;
use std::os::fd::{AsFd, AsRawFd, OwnedFd};
use std::os::unix::process::ExitStatusExt as _;
use std::process::ExitStatus;

use rustix::event::{PollFd, PollFlags, Timespec, poll};
use rustix::io::Errno;
use rustix::process::{Pid, Signal, WaitId, WaitIdOptions, kill_process_group, waitid};

/// `PIDFD_SIGNAL_PROCESS_GROUP` of pidfd_send_signal(2), since Linux 6.9.
const SIGNAL_GROUP: libc::c_uint = 1 << 2;
/// `PIDFD_INFO_EXIT` of `struct pidfd_info`, since Linux 6.15.
const INFO_EXIT: u64 = 1 << 3;

/// The first published form of `struct pidfd_info`; the kernel fills as much as it is given.
#[repr(C)]
#[derive(Default)]
struct Info {
    mask: u64,
    cgroup: u64,
    ids: [u32; 11],
    exit_code: i32,
}

/// `PIDFD_GET_INFO`: `_IOWR(0xFF, 11, struct pidfd_info)`.
const GET_INFO: u64 = (3 << 30) | ((size_of::<Info>() as u64) << 16) | (0xff << 8) | 11;

/// How a process ended.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum End {
    /// By itself, with this status.
    Status(i32),
    /// By a signal.
    Signal(i32),
}

impl End {
    /// How a child ended; `None` for one that only stopped.
    pub(super) fn of(status: ExitStatus) -> Option<Self> {
        status.code().map(Self::Status).or_else(|| status.signal().map(Self::Signal))
    }
}

/// Sends a signal to the group that the process leads, be its number reused or not.
#[expect(unsafe_code, reason = "a system call with a flag that no safe wrapper knows")]
pub(super) fn signal_group(handle: &OwnedFd, group: Pid, signal: Signal) -> io::Result<()> {
    let no_info: *const libc::c_void = std::ptr::null();
    // SAFETY: the descriptor is open as long as it is borrowed; a null `siginfo_t` asks the
    // kernel to make one.
    let done = unsafe {
        libc::syscall(
            libc::SYS_pidfd_send_signal,
            handle.as_raw_fd(),
            signal.as_raw(),
            no_info,
            SIGNAL_GROUP,
        )
    };
    if done == 0 {
        return Ok(());
    }
    let error = io::Error::last_os_error();
    if error.raw_os_error() != Some(libc::EINVAL) {
        return Err(error);
    }
    // Before Linux 6.9: its number is its own as long as it has not ended.
    match has_ended(handle) {
        true => Err(Errno::SRCH.into()),
        false => Ok(kill_process_group(group, signal)?),
    }
}

/// How it ended; `None` while that cannot be known: it was not reaped by whoever is its
/// parent, or the kernel is older than 6.15.
pub(super) fn end(handle: &OwnedFd) -> Option<End> {
    // After an upgrade in place the processes are still our children.
    match waitid(WaitId::PidFd(handle.as_fd()), WaitIdOptions::EXITED | WaitIdOptions::NOHANG) {
        Ok(Some(status)) => {
            let code = status.exit_status().map(End::Status);
            code.or_else(|| status.terminating_signal().map(End::Signal))
        }
        Ok(None) | Err(_) => told_by_kernel(handle),
    }
}

#[expect(unsafe_code, reason = "an ioctl that no safe wrapper knows")]
fn told_by_kernel(handle: &OwnedFd) -> Option<End> {
    let mut info = Info { mask: INFO_EXIT, ..Info::default() };
    // SAFETY: the kernel writes at most the size that the request's number carries, which is
    // that of `info`; every bit pattern of it is a value.
    let done = unsafe { libc::ioctl(handle.as_raw_fd(), GET_INFO as _, &raw mut info) };
    (done == 0 && info.mask & INFO_EXIT != 0).then(|| {
        let status = info.exit_code;
        match status & 0x7f {
            0 => End::Status((status >> 8) & 0xff),
            signal => End::Signal(signal),
        }
    })
}

/// Whether it has ended, reaped or not.
pub(super) fn has_ended(handle: &OwnedFd) -> bool {
    let at_once = Timespec { tv_sec: 0, tv_nsec: 0 };
    // Without an answer it counts as ended, and nothing is done to its number.
    !matches!(poll(&mut [PollFd::new(handle, PollFlags::IN)], Some(&at_once)), Ok(0))
}

#[cfg(test)]
mod tests {
    use std::os::unix::process::CommandExt as _;
    use std::process::Command;

    use rustix::process::{PidfdFlags, pidfd_open};

    use super::*;

    #[test]
    fn the_layout_is_the_kernels() {
        assert_eq!(size_of::<Info>(), 64);
        assert_eq!(GET_INFO, 0xc040_ff0b);
    }

    #[test]
    fn a_group_is_signalled_and_its_leaders_end_is_known() {
        let mut child = Command::new("sleep").arg("1000").process_group(0).spawn().unwrap();
        let pid = Pid::from_child(&child);
        let handle = pidfd_open(pid, PidfdFlags::empty()).unwrap();
        assert!(!has_ended(&handle));
        assert_eq!(end(&handle), None);

        signal_group(&handle, pid, Signal::TERM).unwrap();
        let mut fds = [PollFd::new(&handle, PollFlags::IN)];
        poll(&mut fds, None).unwrap();

        assert!(has_ended(&handle));
        assert_eq!(end(&handle), Some(End::Signal(15)));
        // It was reaped by that.
        assert!(child.try_wait().is_err());
    }
}
