//! One agent's process, and what it may leave behind.

use std::{
    fs::{self, File},
    io,
    os::unix::process::CommandExt as _,
    path::{Path, PathBuf},
    process::{Child, Command, ExitStatus, Stdio},
    time::{Duration, Instant},
};

use rustix::process::{Pid, Signal, kill_process, kill_process_group};
use sdr_core::order::hash64;
use serde::Deserialize;

use super::config::Places;
use crate::{client::Client, failure::Failure};

/// Where POSIX shared memory lies on Linux.
const SHARED_MEMORY: &str = "/dev/shm";
/// How often a process is asked whether it has ended.
const LOOK_EVERY: Duration = Duration::from_millis(10);
/// How long the kernel may take to end a process that was killed.
const KILLED_WITHIN: Duration = Duration::from_secs(5);

/// A running agent.
pub(crate) struct Agent {
    /// The robot's name.
    pub(crate) robot: &'static str,
    /// Its API.
    pub(crate) client: Client,
    socket: PathBuf,
    state: PathBuf,
    log: PathBuf,
    child: Child,
}

/// One process of an agent's list (`processes.json`), as far as it is needed.
#[derive(Debug, Deserialize)]
struct Leftover {
    pid: u32,
    start_time: u64,
}

impl Agent {
    /// Starts `program` in a process group of its own: the terminal's Ctrl-C is ours alone. Its
    /// standard input is held open by us, and when even SIGKILL ends us it ends too.
    pub(super) fn start(
        robot: &'static str,
        program: &Path,
        places: &Places,
    ) -> Result<Self, Failure> {
        let tell = |error: io::Error| {
            Failure::new(format!("cannot start {} for {robot}: {error}", program.display()))
        };
        let log = File::create(&places.log).map_err(tell)?;
        let errors = log.try_clone().map_err(tell)?;
        let child = Command::new(program)
            .arg("--config")
            .arg(&places.config)
            .arg("--end-with-stdin")
            .stdin(Stdio::piped())
            .stdout(log)
            .stderr(errors)
            .process_group(0)
            .spawn()
            .map_err(tell)?;
        Ok(Self {
            robot,
            client: Client::at(&places.socket),
            socket: places.socket.clone(),
            state: places.state.clone(),
            log: places.log.clone(),
            child,
        })
    }

    /// How it ended, when it has.
    pub(crate) fn ended(&mut self) -> Option<ExitStatus> {
        self.child.try_wait().ok().flatten()
    }

    /// Where its API listens.
    pub(crate) fn socket(&self) -> &Path {
        &self.socket
    }

    /// The last lines it wrote.
    pub(crate) fn last_lines(&self, count: usize) -> Vec<String> {
        let text = fs::read(&self.log).unwrap_or_default();
        let text = String::from_utf8_lossy(&text);
        let lines: Vec<&str> = text.lines().collect();
        lines[lines.len().saturating_sub(count)..].iter().map(|line| (*line).to_owned()).collect()
    }

    /// Asks it to end.
    pub(super) fn ask_to_end(&mut self) {
        if self.ended().is_none()
            && let Some(pid) = pid(self.child.id())
        {
            // It may end at this very moment.
            let _ = kill_process(pid, Signal::TERM);
        }
    }

    /// Waits until `deadline`, then kills it, then ends what it left: processes first, then memory.
    pub(super) fn end(&mut self, deadline: Instant) {
        while self.ended().is_none() && Instant::now() < deadline {
            std::thread::sleep(LOOK_EVERY);
        }
        if self.ended().is_none()
            && let Some(pid) = pid(self.child.id())
        {
            let _ = kill_process_group(pid, Signal::KILL);
            let _ = self.child.wait();
        }
        end_leftovers(&self.state.join("processes.json"));
        remove_shared_memory(&short_name(self.robot, &self.socket), Path::new(SHARED_MEMORY));
    }
}

/// Kills the process groups that the agent's list names, when they still are the same.
fn end_leftovers(list: &Path) {
    let text = fs::read(list).unwrap_or_default();
    let leftovers: Vec<Leftover> = serde_json::from_slice(&text).unwrap_or_default();
    let alive = |one: &Leftover| start_time(one.pid) == Some(one.start_time);
    for one in leftovers.iter().filter(|one| alive(one)) {
        if let Some(pid) = pid(one.pid) {
            let _ = kill_process_group(pid, Signal::KILL);
        }
    }
    let since = Instant::now();
    while leftovers.iter().any(alive) && since.elapsed() < KILLED_WITHIN {
        std::thread::sleep(LOOK_EVERY);
    }
}

/// The names under which the agent of `robot` keeps shared memory; the agent makes them the same way.
fn short_name(robot: &str, socket: &Path) -> String {
    let hash = format!("{:016x}", hash64(format!("{robot} {}", socket.display()).as_bytes()));
    hash[8..].to_owned()
}

fn remove_shared_memory(short: &str, root: &Path) {
    let prefix = format!("s{short}_");
    let entries = fs::read_dir(root).into_iter().flatten().flatten();
    for entry in entries {
        if entry.file_name().as_encoded_bytes().starts_with(prefix.as_bytes()) {
            let _ = fs::remove_file(entry.path());
        }
    }
    let shared = root.join("sdr");
    let _ = fs::remove_dir_all(shared.join(short));
    // Stays while another agent of this machine has something there.
    let _ = fs::remove_dir(shared);
}

fn pid(number: u32) -> Option<Pid> {
    Pid::from_raw(i32::try_from(number).ok()?)
}

/// When a process started, ticks after boot; `None` when it is gone or a zombie.
fn start_time(pid: u32) -> Option<u64> {
    let stat = fs::read_to_string(format!("/proc/{pid}/stat")).ok()?;
    // Behind the name in brackets, which may hold anything: state, then field 22 of all.
    let mut fields = stat.rsplit_once(')')?.1.split_whitespace();
    let state = fields.next()?;
    if state == "Z" { None } else { fields.nth(18)?.parse().ok() }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_process_on_the_list_is_ended_and_a_stranger_with_its_number_is_not() {
        let folder = tempfile::tempdir().unwrap();
        let sleeper = || Command::new("sleep").arg("600").process_group(0).spawn().unwrap();
        let (mut ours, mut stranger) = (sleeper(), sleeper());
        let entry = |child: &Child, later: u64| {
            let start = start_time(child.id()).unwrap() + later;
            serde_json::json!({ "component": "a/b", "pid": child.id(), "start_time": start })
        };
        let list = folder.path().join("processes.json");
        let text = serde_json::to_string(&[entry(&ours, 0), entry(&stranger, 1)]).unwrap();
        fs::write(&list, text).unwrap();

        end_leftovers(&list);

        assert!(!ours.wait().unwrap().success());
        assert!(stranger.try_wait().unwrap().is_none());
        stranger.kill().unwrap();
        stranger.wait().unwrap();
    }

    #[test]
    fn only_the_agents_own_shared_memory_goes() {
        let root = tempfile::tempdir().unwrap();
        let short = short_name("robot-1", Path::new("/tmp/x/1/a.sock"));
        assert_eq!(short.len(), 8);
        for folder in [&short, "other"] {
            fs::create_dir_all(root.path().join("sdr").join(folder)).unwrap();
        }
        fs::write(root.path().join(format!("s{short}_data")), "").unwrap();
        fs::write(root.path().join("someone"), "").unwrap();

        remove_shared_memory(&short, root.path());

        assert!(!root.path().join("sdr").join(&short).exists());
        assert!(!root.path().join(format!("s{short}_data")).exists());
        assert!(root.path().join("sdr/other").exists() && root.path().join("someone").exists());
    }

    #[test]
    fn a_missing_or_broken_list_ends_nobody() {
        end_leftovers(Path::new("/nowhere/processes.json"));
        let folder = tempfile::tempdir().unwrap();
        let list = folder.path().join("processes.json");
        fs::write(&list, "{").unwrap();
        end_leftovers(&list);
    }
}
