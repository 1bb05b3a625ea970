//! One agent alone: from its start to an answer of its API, and what it costs when idle.
//! Baseline in the same run: starting `/bin/true` and waiting for its end.

use std::{
    error::Error,
    fs,
    io::{Read, Write},
    os::unix::net::UnixStream,
    path::Path,
    process::{Child, Command, Stdio},
    thread,
    time::{Duration, Instant},
};

use clap::Parser;
use rustix::process::{Pid, Signal, kill_process};
use sdr_benches::{Series, line, programs, row};

/// Arguments.
#[derive(Debug, Parser)]
struct Args {
    /// Starts of an agent.
    #[arg(long, default_value_t = 30)]
    trials: usize,
    /// How long the idle agent is watched, in seconds.
    #[arg(long, default_value_t = 20)]
    idle_s: u64,
}

fn main() -> Result<(), Box<dyn Error>> {
    let args = Args::parse();
    let (mut ready, mut baseline) = (Series::default(), Series::default());
    for _ in 0..args.trials {
        let begun = Instant::now();
        Command::new("/bin/true").status()?;
        baseline.push(millis(begun));
        let folder = tempfile::tempdir()?;
        let (mut agent, took) = start(folder.path())?;
        ready.push(took);
        stop(&mut agent)?;
    }
    let folder = tempfile::tempdir()?;
    let (mut agent, _) = start(folder.path())?;
    let watch = Duration::from_secs(args.idle_s);
    let before = cpu_ticks(agent.id())?;
    thread::sleep(watch);
    let ticks = cpu_ticks(agent.id())? - before;
    let hertz = rustix::param::clock_ticks_per_second();
    let mut cpu = Series::default();
    #[expect(clippy::cast_precision_loss, reason = "few ticks")]
    cpu.push(ticks as f64 / hertz as f64 / watch.as_secs_f64() * 100.0);
    let mut memory = Series::default();
    memory.push(resident_mega(agent.id())?);
    stop(&mut agent)?;
    let mut size = Series::default();
    #[expect(clippy::cast_precision_loss, reason = "few bytes")]
    size.push(fs::metadata(programs()?.join("sdr-agent"))?.len() as f64 / 1e6);

    line(&format!("{:<44} {:>9} {:>9}   bar", "sdr-agent alone", "p50", "worst"))?;
    row("start to API ready, ms", &ready, "<= 50", 1)?;
    row("baseline: start and end of /bin/true, ms", &baseline, "", 1)?;
    row("idle: RSS MB", &memory, "<= 20", 1)?;
    row("idle: CPU % of a core", &cpu, "<= 1", 2)?;
    row("size of the binary, MB", &size, "<= 12", 1)?;
    Ok(())
}

/// Starts an agent and waits for the first answer of its API; milliseconds it took.
fn start(folder: &Path) -> Result<(Child, f64), Box<dyn Error>> {
    let config = folder.join("robot.toml");
    let text = "[robot]\nname = \"robot-1\"\n[mesh]\nunsealed = true\nlisten = \"127.0.0.1:0\"\n\
                [api]\nsocket = \"a.sock\"\n[storage]\nstate = \"state\"\n";
    fs::write(&config, text)?;
    let socket = folder.join("a.sock");
    let begun = Instant::now();
    let agent = Command::new(programs()?.join("sdr-agent"))
        .arg("--config")
        .arg(&config)
        .stdin(Stdio::null())
        .stdout(Stdio::null())
        .stderr(Stdio::null())
        .spawn()?;
    while !answers(&socket) {
        if begun.elapsed() > Duration::from_secs(30) {
            return Err("the agent's API does not answer".into());
        }
        thread::sleep(Duration::from_micros(200));
    }
    Ok((agent, millis(begun)))
}

fn answers(socket: &Path) -> bool {
    let ask = || {
        let mut stream = UnixStream::connect(socket)?;
        stream.write_all(b"GET /v1/health HTTP/1.0\r\nHost: x\r\n\r\n")?;
        let mut answer = String::new();
        stream.read_to_string(&mut answer)?;
        Ok::<_, std::io::Error>(answer.contains(" 200 "))
    };
    ask().unwrap_or(false)
}

fn stop(agent: &mut Child) -> Result<(), Box<dyn Error>> {
    kill_process(Pid::from_child(agent), Signal::TERM)?;
    agent.wait()?;
    Ok(())
}

/// User and system time of a process, in clock ticks (`proc(5)`, fields 14 and 15).
fn cpu_ticks(pid: u32) -> Result<u64, Box<dyn Error>> {
    let stat = fs::read_to_string(format!("/proc/{pid}/stat"))?;
    let (_, rest) = stat.rsplit_once(") ").ok_or("no stat line")?;
    let fields: Vec<&str> = rest.split(' ').collect();
    Ok(fields[11].parse::<u64>()? + fields[12].parse::<u64>()?)
}

fn resident_mega(pid: u32) -> Result<f64, Box<dyn Error>> {
    let status = fs::read_to_string(format!("/proc/{pid}/status"))?;
    let line = status.lines().find(|line| line.starts_with("VmRSS:")).ok_or("no VmRSS")?;
    let kibi: f64 = line.split_whitespace().nth(1).ok_or("no figure")?.parse()?;
    Ok(kibi * 1024.0 / 1e6)
}

fn millis(begun: Instant) -> f64 {
    begun.elapsed().as_secs_f64() * 1000.0
}
