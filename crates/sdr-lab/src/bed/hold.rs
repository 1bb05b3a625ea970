//! What runs inside a robot: the program `sdr`, started again by the bed in one of three roles.
//!
//! ```text
//!  bed ─ socket ─ hold    network and mounts of the robot; lives as long as the robot exists
//!  bed ─ socket ─ boot    enters them, makes a fresh process tree, shared memory and boot id
//!                  └─ init   the tree's first process: starts the agent, sends signals
//! ```
//!
//! Each ends when its socket closes, and the kernel ends all of a tree with its first process: however the
//! bed ends, nothing of a robot stays.

use std::{
    fs::{self, File},
    io::{self, Read as _},
    mem::MaybeUninit,
    os::{
        fd::{AsFd as _, BorrowedFd},
        unix::net::UnixStream,
    },
    path::{Path, PathBuf},
    process::{Command, ExitCode},
};

use rustix::{
    net::{SendAncillaryBuffer, SendAncillaryMessage, SendFlags, sendmsg},
    process::{getgid, getuid},
    thread::{LinkNameSpaceType, UnshareFlags, move_into_link_name_space},
};
use serde::{Deserialize, Serialize};

use super::{
    body::BodyPaths,
    init,
    slow::Disk,
    sys::{self, Address},
};

/// The interface of every robot.
pub(super) const INTERFACE: &str = "wlan0";

/// How the program is started again.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub(super) enum Role {
    /// See the module.
    Hold {
        /// The robot's number, for its addresses.
        number: u16,
        /// Whether namespaces of users are needed.
        user: bool,
        /// A small disk of its own: where, and its bytes.
        disk: Option<(PathBuf, u64)>,
    },
    /// See the module.
    Boot {
        /// Whose network and mounts.
        holder: u32,
        /// As in `Hold`.
        user: bool,
        /// Whether its disk can be slowed.
        slows: bool,
        /// The robot's folder, for what it sees of its body.
        folder: PathBuf,
    },
    /// See the module.
    Init {
        /// As in `Boot`.
        slows: bool,
        /// As in `Boot`.
        folder: PathBuf,
    },
}

impl Role {
    /// As one argument of the program.
    pub(super) fn word(&self) -> io::Result<String> {
        Ok(serde_json::to_string(self)?)
    }
}

/// Plays the role that `word` names, until standard input closes.
pub fn play(word: &str) -> ExitCode {
    let played = serde_json::from_str(word).map_err(io::Error::from).and_then(|role| match role {
        Role::Hold { number, user, disk } => hold(number, user, disk.as_ref()),
        Role::Boot { holder, user, slows, folder } => boot(holder, user, slows, &folder),
        Role::Init { slows, folder } => init(slows, &folder),
    });
    match played {
        Ok(()) => ExitCode::SUCCESS,
        Err(error) => {
            // The bed reads this.
            let _ = io::Write::write_all(&mut io::stderr(), format!("{error}\n").as_bytes());
            ExitCode::FAILURE
        }
    }
}

/// An error with what was tried.
fn because(what: &str) -> impl Fn(io::Error) -> io::Error {
    let what = what.to_owned();
    move |error| io::Error::new(error.kind(), format!("{what}: {error}"))
}

fn hold(number: u16, user: bool, disk: Option<&(PathBuf, u64)>) -> io::Result<()> {
    let (uid, gid) = (getuid().as_raw(), getgid().as_raw());
    let mut fresh = UnshareFlags::NEWNET | UnshareFlags::NEWNS;
    if user {
        fresh |= UnshareFlags::NEWUSER;
    }
    sys::leave(fresh).map_err(because("make namespaces"))?;
    if user {
        sys::map_root(uid, gid).map_err(because("map the user to root of its namespace"))?;
    }
    sys::keep_mounts_here().map_err(because("keep mounts to the robot"))?;
    if let Some((folder, bytes)) = disk {
        let size = format!("size={bytes},mode=0755");
        sys::mount_tmpfs(folder, &size).map_err(because("mount the robot's small disk"))?;
    }
    // Fewer surprises in what is sent; a kernel without IPv6 has nothing to turn off.
    let _ = fs::write("/proc/sys/net/ipv6/conf/all/disable_ipv6", "1");
    let tap = sys::tap(INTERFACE).map_err(because(sys::TUN))?;
    sys::up("lo").map_err(because("bring lo up"))?;
    sys::configure(
        INTERFACE,
        &Address { mac: super::frame::mac(number), ip: super::ip(number), mask: super::MASK },
    )
    .map_err(because("configure wlan0"))?;
    let bed = UnixStream::from(io::stdin().as_fd().try_clone_to_owned()?);
    pass(&bed, tap.as_fd())?;
    drop(tap);
    wait_for_end(&bed)
}

/// Hands a descriptor to the bed.
fn pass(bed: &UnixStream, descriptor: BorrowedFd<'_>) -> io::Result<()> {
    let mut space = [MaybeUninit::uninit(); rustix::cmsg_space!(ScmRights(1))];
    let mut control = SendAncillaryBuffer::new(&mut space);
    let descriptors = [descriptor];
    control.push(SendAncillaryMessage::ScmRights(&descriptors));
    sendmsg(bed, &[io::IoSlice::new(b"t")], &mut control, SendFlags::empty())?;
    Ok(())
}

fn wait_for_end(mut bed: &UnixStream) -> io::Result<()> {
    let mut byte = [0];
    while bed.read(&mut byte)? > 0 {}
    Ok(())
}

fn boot(holder: u32, user: bool, slows: bool, folder: &Path) -> io::Result<()> {
    let mut spaces = vec![("net", LinkNameSpaceType::Network), ("mnt", LinkNameSpaceType::Mount)];
    if user {
        spaces.insert(0, ("user", LinkNameSpaceType::User));
    }
    let open = |(name, kind)| {
        let path = format!("/proc/{holder}/ns/{name}");
        File::open(&path).map(|file| (file, kind)).map_err(because(&path))
    };
    // All are opened first: inside, this /proc is out of reach.
    let spaces: Vec<(File, LinkNameSpaceType)> =
        spaces.into_iter().map(open).collect::<io::Result<_>>()?;
    let program = std::env::current_exe()?;
    for (file, kind) in &spaces {
        move_into_link_name_space(file.as_fd(), Some(*kind))
            .map_err(|error| because("enter the robot's namespaces")(error.into()))?;
    }
    sys::leave(UnshareFlags::NEWPID | UnshareFlags::NEWNS)
        .map_err(because("make a fresh tree of processes"))?;
    let role = Role::Init { slows, folder: folder.to_owned() };
    // Its own standard input and errors are the first process's, too.
    let status = Command::new(program).arg(super::ROLE).arg(role.word()?).status()?;
    if status.success() {
        return Ok(());
    }
    Err(io::Error::other(format!("the robot's first process ended: {status}")))
}

fn init(slows: bool, folder: &Path) -> io::Result<()> {
    sys::keep_mounts_here().map_err(because("keep mounts to the boot"))?;
    sys::mount_proc().map_err(because("mount /proc"))?;
    sys::mount_tmpfs(Path::new("/dev/shm"), "mode=1777").map_err(because("mount /dev/shm"))?;
    let seen = BodyPaths::new(folder);
    for (file, place) in [
        (&seen.meminfo, "/proc/meminfo"),
        (&seen.stat, "/proc/stat"),
        (&seen.boot_id, "/proc/sys/kernel/random/boot_id"),
    ] {
        sys::mount_file(file, Path::new(place)).map_err(because(place))?;
    }
    let disk = if slows { Some(Disk::hold().map_err(because("hold the disk"))?) } else { None };
    init::run(UnixStream::from(io::stdin().as_fd().try_clone_to_owned()?), disk.as_ref())
}
