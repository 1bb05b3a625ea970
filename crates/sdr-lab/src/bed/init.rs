//! The first process of a robot's tree: carries out orders, and collects what ended.

use std::{
    fs::{self, File},
    io::{self, Write as _},
    os::unix::{net::UnixStream, process::CommandExt as _},
    path::Path,
    process::{Command, Stdio},
    sync::{Arc, Condvar, Mutex, PoisonError},
    thread::Builder,
};

use rustix::process::{Pid, Signal, WaitOptions, kill_process, wait};

use super::{
    orders::{Answer, Line, Order, Whom},
    slow::Disk,
};

/// The variable that names a process's component, `system/component`.
const COMPONENT: &str = "SDR_COMPONENT=";
/// The file that fills a disk.
const FILLER: &str = "filler";

/// Runs until the bed closes its end; then the kernel ends all that was started.
pub(super) fn run(bed: UnixStream, disk: Option<&Disk>) -> io::Result<()> {
    let mut line = Line::new(bed)?;
    let agent = Arc::new(Agent::default());
    let mut mouth = line.mouth()?;
    let collector = Arc::clone(&agent);
    Builder::new().name("collector".to_owned()).spawn(move || collect(&collector, &mut mouth))?;
    while let Some(order) = line.hear::<Order>()? {
        let answer = match carry_out(order, &agent, disk) {
            Ok(count) => Answer::Done { count },
            Err(error) => Answer::Failed { reason: error.to_string() },
        };
        line.say(&answer)?;
    }
    Ok(())
}

/// The running agent.
#[derive(Debug, Default)]
struct Agent {
    pid: Mutex<Option<Pid>>,
    /// Something was started: there is something to collect.
    started: Condvar,
}

impl Agent {
    fn set(&self, pid: Option<Pid>) {
        *self.pid.lock().unwrap_or_else(PoisonError::into_inner) = pid;
        self.started.notify_all();
    }

    fn pid(&self) -> Option<Pid> {
        *self.pid.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

fn carry_out(order: Order, agent: &Agent, disk: Option<&Disk>) -> io::Result<usize> {
    match order {
        Order::Start { program, arguments, environment, log } => {
            let mut command = Command::new(&program);
            command.args(arguments).envs(environment);
            start(command, &log, agent).map_err(|error| {
                io::Error::new(error.kind(), format!("start {}: {error}", program.display()))
            })
        }
        Order::Signal { whom, signal } => {
            let signal = Signal::from_named_raw(signal)
                .ok_or_else(|| io::Error::other(format!("no signal {signal}")))?;
            let pids = match whom {
                Whom::Agent => agent.pid().into_iter().collect(),
                Whom::Component(name) => processes_of(&name),
            };
            let count = pids.len();
            for pid in pids {
                // It may have ended by itself.
                let _ = kill_process(pid, signal);
            }
            Ok(count)
        }
        Order::Fill { folder, full } => fill(&folder, full),
        Order::Slow { delay } => match disk {
            Some(disk) => {
                disk.slow(delay);
                Ok(0)
            }
            None => Err(io::Error::other("this robot's disk cannot be slowed")),
        },
    }
}

/// Starts the agent; the collector waits for it.
fn start(mut command: Command, log: &Path, agent: &Agent) -> io::Result<usize> {
    let log = File::options().create(true).append(true).open(log)?;
    command.stdin(Stdio::null()).stdout(log.try_clone()?).stderr(log).process_group(0);
    // Held until its number is known, so that its end is not collected before.
    let mut place = agent.pid.lock().unwrap_or_else(PoisonError::into_inner);
    let child = command.spawn()?;
    *place = Some(Pid::from_child(&child));
    drop(place);
    agent.started.notify_all();
    Ok(1)
}

/// Collects every process of the tree that lost its parent, as a first process must.
fn collect(agent: &Agent, mouth: &mut UnixStream) {
    loop {
        match wait(WaitOptions::empty()) {
            Ok(Some((pid, status))) => {
                if agent.pid() == Some(pid) {
                    agent.set(None);
                    let status = match (status.exit_status(), status.terminating_signal()) {
                        (Some(code), _) => format!("exit code {code}"),
                        (None, Some(signal)) => format!("signal {signal}"),
                        (None, None) => "unknown".to_owned(),
                    };
                    let text = serde_json::to_string(&Answer::AgentEnded { status });
                    let text = text.expect("an answer is plain data");
                    // Nobody is left to be told when the bed is gone.
                    let _ = mouth.write_all(format!("{text}\n").as_bytes());
                }
            }
            Ok(None) => {}
            Err(_) => {
                // No child at all: wait until one is started.
                let pid = agent.pid.lock().unwrap_or_else(PoisonError::into_inner);
                if pid.is_none() {
                    drop(agent.started.wait(pid));
                }
            }
        }
    }
}

/// Processes of a component in this tree.
fn processes_of(name: &str) -> Vec<Pid> {
    let matches = |variable: &[u8]| {
        let Some(found) = variable.strip_prefix(COMPONENT.as_bytes()) else { return false };
        let found = String::from_utf8_lossy(found);
        found == name || found.split_once('/').is_some_and(|(_, component)| component == name)
    };
    let entries = fs::read_dir("/proc").into_iter().flatten().flatten();
    let pids = entries.filter_map(|entry| entry.file_name().to_string_lossy().parse::<i32>().ok());
    pids.filter(|pid| {
        let environment = fs::read(format!("/proc/{pid}/environ")).unwrap_or_default();
        environment.split(|byte| *byte == 0).any(matches)
    })
    .filter_map(Pid::from_raw)
    .collect()
}

fn fill(folder: &Path, full: bool) -> io::Result<usize> {
    let path = folder.join(FILLER);
    if !full {
        fs::remove_file(path)?;
        return Ok(0);
    }
    let mut file = File::create(path)?;
    // Large pieces first, then what is left of the last one.
    for piece in [vec![0_u8; 1 << 16], vec![0_u8; 512], vec![0_u8; 1]] {
        while file.write_all(&piece).is_ok() {}
    }
    Ok(0)
}
