//! One robot, seen from outside.

use std::{
    io::{self, IoSliceMut, Read as _},
    mem::MaybeUninit,
    os::{
        fd::{AsFd as _, OwnedFd},
        unix::{net::UnixStream, process::CommandExt as _},
    },
    path::{Path, PathBuf},
    process::{Child, Command, Stdio},
    time::Duration,
};

use rustix::net::{RecvAncillaryBuffer, RecvAncillaryMessage, RecvFlags, recvmsg};

use super::{
    BedError, RobotConfig,
    body::BodyPaths,
    hold::Role,
    orders::{Answer, Line, Order, Whom},
};

/// How long a robot's processes may take for an order.
const ANSWER_WITHIN: Duration = Duration::from_secs(10);

/// A program to start on a robot.
#[derive(Clone, Debug)]
pub struct Program {
    /// The executable.
    pub path: PathBuf,
    /// Its arguments.
    pub arguments: Vec<String>,
    /// Variables beside those of this process.
    pub environment: Vec<(String, String)>,
    /// Where its output goes.
    pub log: PathBuf,
}

/// A robot: its network and disk, and while it is on its tree of processes.
#[derive(Debug)]
pub struct Robot {
    /// Its name.
    pub name: String,
    folder: PathBuf,
    user: bool,
    slows: bool,
    holder: Helper,
    boot: Option<Boot>,
    boots: u64,
    agent_ended: Option<String>,
}

/// A process of ours with its socket; it ends when that closes.
#[derive(Debug)]
struct Helper {
    child: Child,
    socket: Option<UnixStream>,
}

#[derive(Debug)]
struct Boot {
    // Closed first: the helper's end waits for it.
    line: Line,
    helper: Helper,
}

impl Boot {
    /// Ends it; what it said before.
    fn last_words(self) -> String {
        let Self { line, mut helper } = self;
        drop(line);
        helper.last_words()
    }
}

impl Helper {
    fn start(role: &Role) -> io::Result<Self> {
        let (ours, theirs) = UnixStream::pair()?;
        let child = Command::new(std::env::current_exe()?)
            .arg(super::ROLE)
            .arg(role.word()?)
            .stdin(Stdio::from(OwnedFd::from(theirs)))
            .stdout(Stdio::null())
            .stderr(Stdio::piped())
            // The terminal's Ctrl-C is for the bed alone.
            .process_group(0)
            .spawn()?;
        Ok(Self { child, socket: Some(ours) })
    }

    /// What it said before it ended.
    fn last_words(&mut self) -> String {
        self.socket = None;
        let mut text = String::new();
        if let Some(errors) = &mut self.child.stderr {
            // Whatever could be read is told.
            let _ = errors.read_to_string(&mut text);
        }
        let _ = self.child.wait();
        text.trim().to_owned()
    }
}

impl Drop for Helper {
    fn drop(&mut self) {
        self.socket = None;
        // Its end is that of all its processes: the kernel sees to it.
        let _ = self.child.wait();
    }
}

impl Robot {
    /// Makes the robot, switched off, and gives its end of the radio.
    pub(super) fn new(
        config: &RobotConfig,
        number: u16,
        user: bool,
    ) -> Result<(Self, OwnedFd), BedError> {
        let name = &config.name;
        let role = Role::Hold { number, user, disk: config.disk.clone() };
        let started = Helper::start(&role);
        let mut holder =
            started.map_err(|source| BedError::Start { robot: name.to_owned(), source })?;
        let Some(tap) = holder.socket.as_ref().and_then(receive_descriptor) else {
            let reason = holder.last_words();
            return Err(BedError::Refused { robot: name.to_owned(), reason });
        };
        let robot = Self {
            name: name.to_owned(),
            folder: config.folder.clone(),
            user,
            slows: config.slows,
            holder,
            boot: None,
            boots: 0,
            agent_ended: None,
        };
        Ok((robot, tap))
    }

    /// Its folder.
    pub fn folder(&self) -> &Path {
        &self.folder
    }

    /// Whether it is on.
    pub fn is_on(&self) -> bool {
        self.boot.is_some()
    }

    /// A file as the robot sees it, disks of its own included.
    pub fn seen(&self, path: &Path) -> PathBuf {
        let root = PathBuf::from(format!("/proc/{}/root", self.holder.child.id()));
        root.join(path.strip_prefix("/").unwrap_or(path))
    }

    /// Switches it on: empty shared memory, no process, a boot id of its own.
    pub fn power_on(&mut self) -> Result<(), BedError> {
        if self.is_on() {
            return Ok(());
        }
        let tell = |source| BedError::Start { robot: self.name.clone(), source };
        self.boots += 1;
        let id = format!("{:08x}-0000-4000-8000-{:012x}\n", std::process::id(), self.boots);
        std::fs::write(BodyPaths::new(&self.folder).boot_id, id).map_err(tell)?;
        let role = Role::Boot {
            holder: self.holder.child.id(),
            user: self.user,
            slows: self.slows,
            folder: self.folder.clone(),
        };
        let mut helper = Helper::start(&role).map_err(tell)?;
        let socket = helper.socket.take().ok_or_else(|| tell(io::ErrorKind::BrokenPipe.into()))?;
        let line = Line::new(socket).map_err(tell)?;
        line.wait_at_most(Some(ANSWER_WITHIN)).map_err(tell)?;
        self.agent_ended = None;
        self.boot = Some(Boot { line, helper });
        Ok(())
    }

    /// Takes its power away: every process ends at once, shared memory is gone.
    pub fn power_off(&mut self) {
        // Dropping waits until the kernel has ended all of them.
        self.boot = None;
    }

    /// Starts its agent.
    pub fn start_agent(&mut self, program: &Program) -> Result<(), BedError> {
        self.agent_ended = None;
        let order = Order::Start {
            program: program.path.clone(),
            arguments: program.arguments.clone(),
            environment: program.environment.clone(),
            log: program.log.clone(),
        };
        self.order(&order).map(|_| ())
    }

    /// Sends a signal; how many processes got it.
    pub fn signal(
        &mut self,
        whom: Whom,
        signal: rustix::process::Signal,
    ) -> Result<usize, BedError> {
        self.order(&Order::Signal { whom, signal: signal.as_raw() })
    }

    /// Fills a folder's disk, or makes room again.
    pub fn fill(&mut self, folder: &Path, full: bool) -> Result<(), BedError> {
        self.order(&Order::Fill { folder: folder.to_owned(), full }).map(|_| ())
    }

    /// Lets every write that waits for the disk take so long.
    pub fn slow(&mut self, delay: Duration) -> Result<(), BedError> {
        self.order(&Order::Slow { delay }).map(|_| ())
    }

    /// How its agent ended, when it has.
    pub fn agent_ended(&mut self) -> Option<&str> {
        while let Some(boot) = self.boot.as_mut().filter(|boot| boot.line.has_more()) {
            match boot.line.hear() {
                Ok(Some(Answer::AgentEnded { status })) => self.agent_ended = Some(status),
                Ok(Some(Answer::Done { .. } | Answer::Failed { .. })) => {}
                Ok(None) | Err(_) => break,
            }
        }
        self.agent_ended.as_deref()
    }

    fn order(&mut self, order: &Order) -> Result<usize, BedError> {
        let robot = self.name.clone();
        let Some(boot) = &mut self.boot else { return Err(BedError::Off { robot }) };
        let mut ask = || -> io::Result<Option<Result<usize, String>>> {
            boot.line.say(order)?;
            loop {
                match boot.line.hear()? {
                    Some(Answer::Done { count }) => return Ok(Some(Ok(count))),
                    Some(Answer::Failed { reason }) => return Ok(Some(Err(reason))),
                    Some(Answer::AgentEnded { status }) => self.agent_ended = Some(status),
                    None => return Ok(None),
                }
            }
        };
        match ask() {
            Ok(Some(Ok(count))) => Ok(count),
            Ok(Some(Err(reason))) => Err(BedError::Refused { robot, reason }),
            Ok(None) | Err(_) => {
                let reason = self.boot.take().map(Boot::last_words).unwrap_or_default();
                Err(BedError::Refused { robot, reason })
            }
        }
    }
}

/// The descriptor that the other end hands over; `None` when it ends without.
fn receive_descriptor(socket: &UnixStream) -> Option<OwnedFd> {
    let mut space = [MaybeUninit::uninit(); rustix::cmsg_space!(ScmRights(1))];
    let mut control = RecvAncillaryBuffer::new(&mut space);
    let mut byte = [0];
    let mut data = [IoSliceMut::new(&mut byte)];
    let flags = RecvFlags::CMSG_CLOEXEC;
    let received = recvmsg(socket.as_fd(), &mut data, &mut control, flags).ok()?;
    let messages = control.drain().filter(|_| received.bytes > 0);
    let mut descriptors = messages.filter_map(|message| {
        let RecvAncillaryMessage::ScmRights(descriptors) = message else { return None };
        Some(descriptors)
    });
    descriptors.next()?.next()
}
