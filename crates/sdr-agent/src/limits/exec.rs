//! `sdr-agent exec`: sets limits on itself, then becomes a component.

use std::ffi::OsString;
use std::fs;
use std::io::{self, Write as _};
use std::os::unix::process::CommandExt as _;
use std::path::PathBuf;
use std::process::{Command, ExitCode};

use clap::Parser;
use rustix::process::{Resource, Rlimit, getrlimit, setpriority_process, setrlimit};
use rustix::thread::{CpuSet, sched_setaffinity};

/// The word that makes this program the helper.
pub(crate) const WORD: &str = "exec";
/// Exit status when a limit cannot be set, as shells have it for what cannot be run.
const UNLIMITED: u8 = 126;

/// What the helper is told.
#[derive(Debug, Parser)]
struct Wishes {
    #[arg(long)]
    group: Option<PathBuf>,
    /// Bytes of private memory.
    #[arg(long)]
    data: Option<u64>,
    #[arg(long, allow_hyphen_values = true)]
    nice: Option<i32>,
    #[arg(long)]
    fifo: Option<u8>,
    #[arg(long, value_delimiter = ',')]
    cores: Vec<usize>,
    #[arg(long)]
    lock: bool,
    #[arg(last = true, required = true)]
    command: Vec<OsString>,
}

/// Becomes the component; returns only when that, or a limit before it, fails. The words go
/// to the component's log.
pub(crate) fn run() -> ExitCode {
    let wishes = Wishes::parse_from(std::env::args_os().skip(1));
    let Err(reason) = confine(&wishes) else {
        let (program, arguments) = (&wishes.command[0], &wishes.command[1..]);
        let error = Command::new(program).args(arguments).exec();
        return fail(&format!("{}: {error}", program.display()));
    };
    fail(&reason)
}

fn confine(wishes: &Wishes) -> Result<(), String> {
    if let Some(group) = &wishes.group {
        let file = group.join("cgroup.procs");
        let own = std::process::id().to_string();
        fs::write(&file, own).map_err(|error| format!("limits: {}: {error}", file.display()))?;
    }
    if !wishes.cores.is_empty() {
        stay_on(&wishes.cores)?;
    }
    if let Some(bytes) = wishes.data {
        let limit = Rlimit { current: Some(bytes), maximum: Some(bytes) };
        setrlimit(Resource::Data, limit)
            .map_err(|error| format!("limits: memory of {bytes} bytes: {error}"))?;
    }
    if wishes.lock {
        let maximum = getrlimit(Resource::Memlock).maximum;
        let limit = Rlimit { current: maximum, maximum };
        setrlimit(Resource::Memlock, limit)
            .map_err(|error| format!("limits: lock_memory: {error}"))?;
    }
    if let Some(nice) = wishes.nice {
        setpriority_process(None, nice).map_err(|error| {
            format!("limits: niceness {nice}: {error}; LimitNICE of the agent's unit allows it")
        })?;
    }
    // Last: from here on it is ahead of others.
    wishes.fifo.map_or(Ok(()), be_first)
}

fn stay_on(cores: &[usize]) -> Result<(), String> {
    let mut set = CpuSet::new();
    for core in cores.iter().filter(|core| **core < CpuSet::MAX_CPU) {
        set.set(*core);
    }
    sched_setaffinity(None, &set).map_err(|error| {
        let there = std::thread::available_parallelism().map_or(1, |count| count.get());
        format!("limits: cores {cores:?}: {error}; this robot has {there}, from 0")
    })
}

#[expect(unsafe_code, reason = "a system call that no safe wrapper knows")]
fn be_first(priority: u8) -> Result<(), String> {
    let wanted = libc::sched_param { sched_priority: i32::from(priority) };
    // SAFETY: 0 is this process; the parameter is read during the call only.
    let done = unsafe { libc::sched_setscheduler(0, libc::SCHED_FIFO, &raw const wanted) };
    if done == 0 {
        return Ok(());
    }
    let error = io::Error::last_os_error();
    Err(format!("limits: fifo {priority}: {error}; LimitRTPRIO of the agent's unit allows it"))
}

fn fail(reason: &str) -> ExitCode {
    // Nobody reads it when stderr is closed.
    let _ = writeln!(io::stderr(), "sdr-agent: {reason}");
    ExitCode::from(UNLIMITED)
}
