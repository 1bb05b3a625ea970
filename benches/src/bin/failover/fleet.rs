//! Real agents on loopback, in a folder of their own.

use std::error::Error;
use std::fs;
use std::io::{Read, Write};
use std::net::{Ipv4Addr, UdpSocket};
use std::os::unix::net::UnixStream;
use std::os::unix::process::CommandExt;
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Stdio};
use std::thread;
use std::time::{Duration, Instant};

use rustix::process::{Pid, Signal, kill_process};
use sdr_benches::{monotonic_ns, programs};
use sdr_core::api::EventView;
use tempfile::TempDir;

/// Longest wait for anything; only a broken fleet takes it.
const LIMIT: Duration = Duration::from_secs(60);
/// Time between two looks at a condition.
const LOOK_EVERY: Duration = Duration::from_millis(1);

/// What goes wrong in a bench is told and ends it.
pub(crate) type Outcome<T> = Result<T, Box<dyn Error>>;

/// All robots.
#[derive(Debug)]
pub(crate) struct Fleet {
    pub(crate) agents: Vec<Agent>,
    folder: TempDir,
}

/// One robot's agent.
#[derive(Debug)]
pub(crate) struct Agent {
    folder: PathBuf,
    process: Option<Child>,
}

impl Fleet {
    /// `count` robots that see each other.
    pub(crate) fn start(count: usize) -> Outcome<Self> {
        let folder = tempfile::Builder::new().prefix("sdr").tempdir_in("/dev/shm")?;
        let sockets: Vec<UdpSocket> = (0..count)
            .map(|_| UdpSocket::bind((Ipv4Addr::LOCALHOST, 0)))
            .collect::<Result<_, _>>()?;
        let ports: Vec<u16> = sockets
            .iter()
            .map(|socket| socket.local_addr().map(|address| address.port()))
            .collect::<Result<_, _>>()?;
        drop(sockets);
        let mut fleet = Self { agents: Vec::new(), folder };
        for (number, port) in ports.iter().enumerate() {
            let own = fleet.folder.path().join(format!("r{}", number + 1));
            fs::create_dir(&own)?;
            let others = ports.iter().filter(|other| *other != port);
            let seeds: Vec<String> = others.map(|port| format!("\"127.0.0.1:{port}\"")).collect();
            let text = format!(
                "[robot]\nname = \"robot-{}\"\n[capacity]\nmemory = \"1GB\"\ncpu = \"400%\"\n\
                 [mesh]\nunsealed = true\nlisten = \"127.0.0.1:{port}\"\nseeds = [{}]\n\
                 [components]\npath = [{:?}]\n[ros]\ndomain_id = {}\n[api]\nsocket = \"a.sock\"\n\
                 [storage]\nstate = \"state\"\n",
                number + 1,
                seeds.join(", "),
                programs()?,
                100 + std::process::id() % 100,
            );
            fs::write(own.join("robot.toml"), text)?;
            let mut agent = Agent { folder: own, process: None };
            agent.start()?;
            fleet.agents.push(agent);
        }
        for agent in &fleet.agents {
            until("an answer of the agent", || agent.get("/v1/health").is_ok())?;
        }
        Ok(fleet)
    }

    /// Has the fleet run the system of this text, and waits until it does.
    pub(crate) fn deploy(&self, text: &str) -> Outcome<()> {
        let file = self.folder.path().join("system.yaml");
        fs::write(&file, text)?;
        let mut command = self.sdr(0)?;
        let output =
            command.arg("deploy").arg(file).args(["--wait", "--timeout", "60s"]).output()?;
        match output.status.success() {
            true => Ok(()),
            false => Err(String::from_utf8_lossy(&output.stderr).into_owned().into()),
        }
    }

    /// A file of this fleet.
    pub(crate) fn file(&self, name: &str) -> PathBuf {
        self.folder.path().join(name)
    }

    /// Ends all of it in good order.
    pub(crate) fn stop(&mut self) {
        for number in 0..self.agents.len() {
            // One that does not answer is ended below.
            let _ = self.sdr(number).and_then(|mut sdr| Ok(sdr.arg("stop").output()?));
            self.agents[number].end();
        }
    }

    /// Keeps the folder for whoever looks into a failed trial.
    pub(crate) fn keep(&mut self, out: &Path) -> PathBuf {
        self.stop();
        let kept = out.join(format!("failed-{}", std::process::id()));
        let copied = Command::new("cp").arg("-r").arg(self.folder.path()).arg(&kept).status();
        if copied.is_ok_and(|status| status.success()) { kept } else { PathBuf::from("nowhere") }
    }

    fn sdr(&self, number: usize) -> Outcome<Command> {
        let mut command = Command::new(programs()?.join("sdr"));
        command.arg("--agent").arg(self.agents[number].folder.join("a.sock"));
        Ok(command)
    }
}

impl Drop for Fleet {
    fn drop(&mut self) {
        self.stop();
    }
}

impl Agent {
    /// Starts it; the moment before that, CLOCK_MONOTONIC.
    pub(crate) fn start(&mut self) -> Outcome<u64> {
        let log = fs::File::options().create(true).append(true).open(self.folder.join("log"))?;
        let mut command = Command::new(programs()?.join("sdr-agent"));
        command.arg("--config").arg(self.folder.join("robot.toml"));
        command.stdin(Stdio::null()).stdout(log.try_clone()?).stderr(log).process_group(0);
        let begun = monotonic_ns();
        self.process = Some(command.spawn()?);
        Ok(begun)
    }

    /// `kill -9` of the agent alone.
    pub(crate) fn kill(&mut self) -> Outcome<()> {
        let mut process = self.process.take().ok_or("no agent runs")?;
        process.kill()?;
        process.wait()?;
        Ok(())
    }

    /// What it tells under a path of its API.
    pub(crate) fn get(&self, path: &str) -> Outcome<String> {
        let mut stream = UnixStream::connect(self.folder.join("a.sock"))?;
        write!(stream, "GET {path} HTTP/1.0\r\nHost: x\r\n\r\n")?;
        let mut answer = String::new();
        stream.read_to_string(&mut answer)?;
        let (_, body) = answer.split_once("\r\n\r\n").ok_or("no answer")?;
        Ok(body.into())
    }

    /// Its events of one kind, newer than `since_ns`.
    pub(crate) fn events(&self, kind: &str, since_ns: u64) -> Vec<EventView> {
        let text = self.get("/v1/events").unwrap_or_default();
        let all: Vec<EventView> = serde_json::from_str(&text).unwrap_or_default();
        let is_it = |view: &EventView| view.event.kind == kind && view.monotonic_ns >= since_ns;
        all.into_iter().filter(is_it).collect()
    }

    /// The process of a component's newest instance.
    pub(crate) fn pid_of(&self, component: &str) -> Option<u32> {
        let journal = fs::read_to_string(self.folder.join("state/processes.json")).ok()?;
        let entries: Vec<serde_json::Value> = serde_json::from_str(&journal).ok()?;
        let named = |entry: &&serde_json::Value| {
            entry["component"].as_str().is_some_and(|key| key.ends_with(&format!("/{component}")))
        };
        let newest = entries.iter().filter(named).max_by_key(|entry| entry["instance"].as_u64())?;
        u32::try_from(newest["pid"].as_u64()?).ok()
    }

    fn end(&mut self) {
        let Some(mut process) = self.process.take() else { return };
        let _ = process.kill();
        let _ = process.wait();
    }
}

/// Waits until `done`.
pub(crate) fn until(what: &str, mut done: impl FnMut() -> bool) -> Outcome<()> {
    let end = Instant::now() + LIMIT;
    while !done() {
        if Instant::now() >= end {
            return Err(format!("not within {} s: {what}", LIMIT.as_secs()).into());
        }
        thread::sleep(LOOK_EVERY);
    }
    Ok(())
}

/// Ends a process at once, as a crash would.
pub(crate) fn kill(pid: u32) -> Outcome<()> {
    let pid = i32::try_from(pid).ok().and_then(Pid::from_raw).ok_or("no process id")?;
    Ok(kill_process(pid, Signal::KILL)?)
}
