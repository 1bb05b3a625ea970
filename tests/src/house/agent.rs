//! One real agent and what an operator does with it.

use std::{
    fs,
    io::{Read, Write},
    net::{Ipv4Addr, TcpListener},
    os::unix::{net::UnixStream, process::CommandExt},
    path::{Path, PathBuf},
    process::{Child, Command, Output, Stdio},
};

use rustix::process::{Pid, Signal, kill_process};
use sdr_core::api::{EventView, StatusView};
use sdr_lab::world::RobotPaths;

use super::{LIMIT, Programs, wait_for};

/// An agent process; ended with all its components when dropped.
pub struct Agent {
    /// The robot's name.
    pub name: String,
    /// Its own folder: configuration, state, socket, log.
    pub folder: PathBuf,
    /// Where its mesh listens.
    pub port: u16,
    /// Where its API listens for operators of other machines.
    pub api_port: u16,
    programs: &'static Programs,
    process: Option<Child>,
}

impl Agent {
    pub(super) fn new(fleet: &Path, name: &str, programs: &'static Programs) -> Self {
        let folder = fleet.join(name.replace("robot-", "r"));
        fs::create_dir_all(&folder).expect("a folder");
        Self { name: name.into(), folder, port: 0, api_port: 0, programs, process: None }
    }

    /// Writes robot.toml.
    pub(super) fn configure(&mut self, number: usize, ports: &[u16], domain: u16, world: &Path) {
        self.port = ports[number];
        let body = RobotPaths::new(world, &self.name);
        self.api_port = free_tcp_port();
        let others = ports.iter().filter(|port| **port != self.port);
        let seeds: Vec<String> = others.map(|port| format!("\"127.0.0.1:{port}\"")).collect();
        let text = format!(
            r#"[robot]
name = "{name}"
devices = {{ fisheye = {fisheye:?}, camera = {camera:?}, wheels = {wheels:?} }}
[capacity]
memory = "1.9GB"
cpu = "400%"
[mesh]
keys = {keys:?}
key_grace = "3s"
listen = "127.0.0.1:{port}"
seeds = [{seeds}]
gone_after = "4s"
[radio]
rssi = {{ file = {wireless:?} }}
[sensors]
battery = {{ file = {battery:?} }}
[components]
path = [{scripts:?}, {programs:?}]
[ros]
domain_id = {domain}
[api]
socket = {socket:?}
listen = "127.0.0.1:{api_port}"
[storage]
state = {state:?}
"#,
            name = self.name,
            fisheye = body.fisheye,
            camera = body.camera,
            wheels = body.wheels,
            keys = self.keys(),
            api_port = self.api_port,
            port = self.port,
            seeds = seeds.join(", "),
            wireless = body.wireless,
            battery = body.battery,
            scripts = self.scripts(),
            programs = self.programs.folder(),
            socket = self.socket(),
            state = self.state(),
        );
        fs::create_dir_all(self.scripts()).expect("a folder");
        fs::write(self.config(), text).expect("robot.toml is written");
    }

    /// Replaces words of its robot.toml, which must be there once; for its next start.
    pub fn rewrite(&self, old: &str, new: &str) {
        let text = fs::read_to_string(self.config()).expect("it was written");
        assert_eq!(text.matches(old).count(), 1, "`{old}` in\n{text}");
        fs::write(self.config(), text.replace(old, new)).expect("it is written");
    }

    /// Another port for its mesh, from its next start on.
    pub fn move_away(&mut self) {
        let old = format!("listen = \"127.0.0.1:{}\"", self.port);
        self.port = super::free_ports(1)[0];
        self.rewrite(&old, &format!("listen = \"127.0.0.1:{}\"", self.port));
    }

    /// Starts it; the operating system may still be busy with it when this returns.
    pub fn start(&mut self) {
        let log = fs::File::options().create(true).append(true).open(self.log());
        let log = log.expect("a log");
        let mut command = Command::new(self.programs.agent());
        command.arg("--config").arg(self.config());
        command.stdin(Stdio::null()).stdout(log.try_clone().expect("a log")).stderr(log);
        self.process = Some(command.process_group(0).spawn().expect("the agent starts"));
    }

    /// `kill -9` of the agent alone.
    pub fn kill(&mut self) {
        let mut process = self.process.take().expect("the agent runs");
        process.kill().expect("it can be killed");
        process.wait().expect("it is ours");
    }

    /// Stops the agent alone in the middle of whatever it does, as a host that hangs would.
    pub fn freeze(&self) {
        self.signal(Signal::STOP);
    }

    /// Lets a frozen agent go on.
    pub fn release(&self) {
        self.signal(Signal::CONT);
    }

    fn signal(&self, signal: Signal) {
        let process = self.process.as_ref().expect("the agent runs");
        kill_process(Pid::from_child(process), signal).expect("the process is ours");
    }

    /// Ends it in good order and waits for it.
    pub fn stop(&mut self) {
        let Some(mut process) = self.process.take() else { return };
        let pid = Pid::from_child(&process);
        // it may have ended by itself, or be frozen
        let _ = kill_process(pid, Signal::TERM);
        let _ = kill_process(pid, Signal::CONT);
        let ended = wait_for(LIMIT, || matches!(process.try_wait(), Ok(Some(_))));
        if !ended {
            let _ = process.kill();
            let _ = process.wait();
        }
    }

    /// The agent's process id.
    pub fn pid(&self) -> u32 {
        self.process.as_ref().expect("the agent runs").id()
    }

    /// Runs `sdr ARGUMENTS` against this agent.
    pub fn sdr(&self, arguments: &[&str]) -> Output {
        let mut command = Command::new(self.programs.sdr());
        command.arg("--agent").arg(self.socket()).args(arguments).env("NO_COLOR", "1");
        command.output().expect("sdr runs")
    }

    /// Runs `sdr ARGUMENTS`, which name the agent.
    pub fn sdr_anywhere(&self, arguments: &[&str]) -> Output {
        let mut command = Command::new(self.programs.sdr());
        command.args(arguments).env("NO_COLOR", "1").output().expect("sdr runs")
    }

    /// What it believes; `None` while it does not answer.
    pub fn status(&self) -> Option<StatusView> {
        let output = self.sdr(&["status", "-o", "json"]);
        serde_json::from_slice(&output.stdout).ok()
    }

    /// Its events of one kind.
    pub fn events(&self, kind: &str) -> Vec<EventView> {
        let output = self.sdr(&["events", "-o", "json"]);
        let events: Vec<EventView> = serde_json::from_slice(&output.stdout).unwrap_or_default();
        events.into_iter().filter(|view| view.event.kind == kind).collect()
    }

    /// The process id of a component's newest instance here.
    pub fn component_pid(&self, component: &str) -> Option<u32> {
        self.component_pids(component).pop()
    }

    /// Process ids of all instances of a component that were started here, the first first.
    pub fn component_pids(&self, component: &str) -> Vec<u32> {
        let of = |view: &&EventView| {
            view.event.component.as_ref().is_some_and(|name| name.as_str() == component)
        };
        let started = self.events("started");
        let pids = started.iter().filter(of).filter_map(|view| view.event.numbers.get("pid"));
        #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "a pid")]
        pids.map(|pid| *pid as u32).collect()
    }

    /// Puts an executable script where this robot looks for components.
    pub fn install_script(&self, name: &str, text: &str) {
        use std::os::unix::fs::PermissionsExt;
        let path = self.scripts().join(name);
        let mut file = fs::File::create(&path).expect("a script");
        file.write_all(text.as_bytes()).expect("a script");
        fs::set_permissions(&path, fs::Permissions::from_mode(0o755)).expect("permissions");
    }

    /// Its API socket.
    pub fn socket(&self) -> PathBuf {
        self.folder.join("a.sock")
    }

    /// Its folder of keys.
    pub fn keys(&self) -> PathBuf {
        self.folder.join("keys")
    }

    /// `GET /v1/health`.
    pub fn health(&self) -> serde_json::Value {
        let ask = || -> std::io::Result<String> {
            let mut stream = UnixStream::connect(self.socket())?;
            stream.write_all(b"GET /v1/health HTTP/1.0\r\nHost: x\r\n\r\n")?;
            let mut answer = String::new();
            stream.read_to_string(&mut answer)?;
            Ok(answer)
        };
        let answer = ask().unwrap_or_default();
        serde_json::from_str(answer.split("\r\n\r\n").nth(1).unwrap_or("")).unwrap_or_default()
    }

    /// How much bad input of this kind it counted.
    pub fn bad_input(&self, kind: &str) -> u64 {
        self.health()["bad_input"][kind].as_u64().unwrap_or(0)
    }

    /// Its state folder.
    pub fn state(&self) -> PathBuf {
        self.folder.join("state")
    }

    /// Its log.
    pub fn log(&self) -> PathBuf {
        self.folder.join("agent.log")
    }

    fn config(&self) -> PathBuf {
        self.folder.join("robot.toml")
    }

    fn scripts(&self) -> PathBuf {
        self.folder.join("scripts")
    }

    pub(super) fn story(&self) -> String {
        let log = fs::read_to_string(self.log()).unwrap_or_default();
        let events = self.sdr(&["events"]);
        let events = String::from_utf8_lossy(&events.stdout).into_owned();
        format!("--- {} log\n{log}\n--- {} events\n{events}\n", self.name, self.name)
    }
}

impl Drop for Agent {
    /// Components outlive their agent: they are ended first, those of a killed agent by the
    /// numbers in its journal.
    fn drop(&mut self) {
        if self.process.is_some() {
            self.sdr(&["stop", "--timeout", "10s"]);
        }
        self.stop();
        let journal = fs::read(self.state().join("processes.json")).unwrap_or_default();
        let left: Vec<serde_json::Value> = serde_json::from_slice(&journal).unwrap_or_default();
        for entry in left {
            let (pid, key) = (entry["pid"].as_u64(), entry["component"].as_str());
            let pid = pid.and_then(|pid| u32::try_from(pid).ok());
            if let (Some(pid), Some(key)) = (pid, key)
                && is_component(pid, key)
            {
                kill(pid);
            }
        }
    }
}

/// Whether a process was started as this component.
fn is_component(pid: u32, key: &str) -> bool {
    let environment = fs::read(format!("/proc/{pid}/environ")).unwrap_or_default();
    let wanted = format!("SDR_COMPONENT={key}");
    is_running(pid) && environment.split(|byte| *byte == 0).any(|one| one == wanted.as_bytes())
}

/// A TCP port of loopback that is free now.
fn free_tcp_port() -> u16 {
    let listener = TcpListener::bind((Ipv4Addr::LOCALHOST, 0)).expect("a free port");
    listener.local_addr().expect("bound").port()
}

/// Whether a process of this id runs; one that ended and was not collected yet does not.
pub fn is_running(pid: u32) -> bool {
    let stat = fs::read_to_string(format!("/proc/{pid}/stat")).unwrap_or_default();
    // pid (name) state ...; the name may hold anything
    stat.rsplit_once(") ").is_some_and(|(_, rest)| !rest.starts_with(['Z', 'X']))
}

/// Ends a process at once, as a crash would.
pub fn kill(pid: u32) {
    let pid = i32::try_from(pid).ok().and_then(Pid::from_raw).expect("a process id");
    kill_process(pid, Signal::KILL).expect("the process is ours");
}
