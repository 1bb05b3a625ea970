//! What a robot's agent reads of its body: radio, battery, place, and what else the machine does.

use std::{
    fs::{self, File},
    io,
    os::unix::{fs::FileExt as _, net::UnixStream},
    path::{Path, PathBuf},
    sync::{Arc, Mutex, PoisonError},
    thread::{Builder, JoinHandle},
    time::Duration,
};

use rustix::event::{PollFd, PollFlags, Timespec, poll};

use super::relay::SharedAir;
use crate::radio::{NOISE_FLOOR_DBM, capacity_text, wireless_text, write_whole};

/// Between two writings: the period at which agents sample.
const PERIOD: Duration = Duration::from_millis(100);
/// /proc/net/wireless without an interface.
const NO_INTERFACE: &str = "Inter-| sta-|   Quality        |   Discarded packets               | Missed | WE\n \
     face | tus | link level noise |  nwid  crypt   frag  retry   misc | beacon | 22\n";
/// Ticks of /proc/stat in a second.
const TICKS: f64 = 100.0;

/// Where one robot's files are.
#[derive(Clone, Debug)]
pub struct BodyPaths {
    /// In the format of /proc/net/wireless.
    pub wireless: PathBuf,
    /// Charge in per cent.
    pub battery: PathBuf,
    /// x, y and z in metres.
    pub position: PathBuf,
    /// What the robot sees as /proc/meminfo.
    pub(super) meminfo: PathBuf,
    /// What the robot sees as /proc/stat.
    pub(super) stat: PathBuf,
    /// What the robot sees as its boot id.
    pub(super) boot_id: PathBuf,
}

impl BodyPaths {
    /// Below the robot's folder.
    pub fn new(folder: &Path) -> Self {
        let file = |name: &str| folder.join(name);
        Self {
            wireless: file("wireless"),
            battery: file("battery"),
            position: file("position"),
            meminfo: file("meminfo"),
            stat: file("stat"),
            boot_id: file("boot_id"),
        }
    }
}

/// What a robot's body is told to show.
#[derive(Clone, Copy, Debug)]
pub struct Body {
    /// Charge now and later, per cent.
    battery: (f64, f64, Duration, Duration),
    /// All memory of the robot.
    pub memory_bytes: u64,
    /// What other programs leave of it.
    pub memory_available_bytes: u64,
    /// What other programs use of the processor; 1.0 is one core.
    pub cpu_cores_used: f64,
    /// Ticks that other programs used so far.
    busy_ticks: f64,
}

impl Body {
    /// A quiet robot.
    pub fn new(memory_bytes: u64, battery_percent: f64) -> Self {
        let zero = Duration::ZERO;
        Self {
            battery: (battery_percent, battery_percent, zero, zero),
            memory_bytes,
            memory_available_bytes: memory_bytes,
            cpu_cores_used: 0.0,
            busy_ticks: 0.0,
        }
    }

    /// Lets the charge go to `percent` in a straight line.
    pub fn drain(&mut self, now: Duration, percent: f64, over: Duration) {
        self.battery = (self.battery_percent(now), percent, now, over);
    }

    fn battery_percent(&self, now: Duration) -> f64 {
        let (from, to, since, over) = self.battery;
        let gone = now.saturating_sub(since);
        if gone >= over {
            return to;
        }
        from + (to - from) * gone.as_secs_f64() / over.as_secs_f64()
    }
}

/// All bodies, shared by their thread and whoever changes them.
#[derive(Clone, Debug)]
pub struct Bodies(Arc<Mutex<Vec<Body>>>);

impl Bodies {
    pub(super) fn new(bodies: Vec<Body>) -> Self {
        Self(Arc::new(Mutex::new(bodies)))
    }

    /// Changes one body.
    pub fn change(&self, robot: usize, change: impl FnOnce(&mut Body)) {
        if let Some(body) = self.0.lock().unwrap_or_else(PoisonError::into_inner).get_mut(robot) {
            change(body);
        }
    }
}

/// The thread that writes the files. Dropping it ends it.
#[derive(Debug)]
pub(super) struct Writer {
    wake: Option<UnixStream>,
    thread: Option<JoinHandle<()>>,
}

impl Writer {
    /// Writes all files once, then keeps them fresh.
    pub(super) fn start(
        paths: Vec<BodyPaths>,
        bodies: Bodies,
        air: SharedAir,
        since: Duration,
    ) -> io::Result<Self> {
        let (wake, theirs) = UnixStream::pair()?;
        let mut desk = Desk { paths, bodies, air, since, last: Duration::ZERO };
        for paths in &desk.paths {
            for file in [&paths.meminfo, &paths.stat] {
                File::create(file)?;
            }
            fs::write(&paths.boot_id, "")?;
        }
        desk.write()?;
        let run = move || {
            while !is_over(&theirs) {
                // A full disk now may have room in 100 ms; agents see the file's age meanwhile.
                let _ = desk.write();
            }
        };
        let thread = Builder::new().name("bodies".to_owned()).spawn(run)?;
        Ok(Self { wake: Some(wake), thread: Some(thread) })
    }
}

impl Drop for Writer {
    fn drop(&mut self) {
        drop(self.wake.take());
        if let Some(thread) = self.thread.take() {
            // A thread that panicked has already said so.
            let _ = thread.join();
        }
    }
}

/// Waits for one period; whether `wake` closed meanwhile.
fn is_over(wake: &UnixStream) -> bool {
    let limit = Timespec::try_from(PERIOD).ok();
    let mut fds = [PollFd::new(wake, PollFlags::IN)];
    poll(&mut fds, limit.as_ref()).is_ok_and(|ready| ready > 0)
}

struct Desk {
    paths: Vec<BodyPaths>,
    bodies: Bodies,
    air: SharedAir,
    since: Duration,
    last: Duration,
}

impl Desk {
    fn write(&mut self) -> io::Result<()> {
        let now = super::monotonic().saturating_sub(self.since);
        let passed = now.saturating_sub(self.last).as_secs_f64();
        self.last = now;
        for (robot, paths) in self.paths.iter().enumerate() {
            let (shown, (x, y)) = {
                let mut air = self.air.lock();
                (air.shown_dbm(now, robot), air.position(now, robot))
            };
            let text = shown.map_or_else(
                || NO_INTERFACE.to_owned(),
                |level| wireless_text("wlan0", level, NOISE_FLOOR_DBM),
            );
            write_whole(&paths.wireless, &text)?;
            write_whole(&paths.position, &format!("{x:.3} {y:.3} 0.000\n"))?;
            let mut body = None;
            self.bodies.change(robot, |found| {
                found.busy_ticks += found.cpu_cores_used * passed * TICKS;
                body = Some(*found);
            });
            let Some(body) = body else { continue };
            write_whole(&paths.battery, &capacity_text(body.battery_percent(now)))?;
            write_in_place(&paths.meminfo, &meminfo(&body))?;
            write_in_place(&paths.stat, &stat(&body, now))?;
        }
        Ok(())
    }
}

/// The robot sees the very file, so it cannot be replaced; equal lengths keep it whole.
fn write_in_place(path: &Path, text: &str) -> io::Result<()> {
    File::options().write(true).open(path)?.write_all_at(text.as_bytes(), 0)
}

fn meminfo(body: &Body) -> String {
    let line = |name: &str, bytes: u64| format!("{name:<16}{:>12} kB\n", bytes / 1024);
    let available = body.memory_available_bytes.min(body.memory_bytes);
    [
        line("MemTotal:", body.memory_bytes),
        line("MemFree:", available),
        line("MemAvailable:", available),
        line("Buffers:", 0),
        line("Cached:", 0),
        line("SwapTotal:", 0),
        line("SwapFree:", 0),
        line("Shmem:", 0),
        line("SReclaimable:", 0),
    ]
    .concat()
}

/// All cores are as busy as one another.
fn stat(body: &Body, now: Duration) -> String {
    let cores = std::thread::available_parallelism().map_or(1, usize::from);
    #[expect(clippy::cast_precision_loss, reason = "a number of cores")]
    let count = cores as f64;
    // A second of ticks ahead, so that no counter is ever zero.
    let all = (now.as_secs_f64() + 1.0) * TICKS;
    let busy = (body.busy_ticks / count).min(all);
    let (busy, idle) = (crate::cast::rounded(busy), crate::cast::rounded(all - busy));
    let line = |name: String, factor: i64| {
        format!("{name:<6}{:>14} 0 0 {:>14} 0 0 0 0 0 0\n", busy * factor, idle * factor)
    };
    let mut text = line("cpu".to_owned(), i64::try_from(cores).unwrap_or(1));
    (0..cores).for_each(|core| text.push_str(&line(format!("cpu{core}"), 1)));
    text + "intr 0\nctxt 0\nbtime 1700000000\nprocesses 1\nprocs_running 1\nprocs_blocked 0\n"
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_battery_drains_in_a_straight_line_and_stays() {
        let mut body = Body::new(2_000_000_000, 80.0);
        let second = Duration::from_secs;
        body.drain(second(10), 20.0, second(6));
        let at = |time| body.battery_percent(second(time));
        assert!((at(10) - 80.0).abs() < 1e-9 && (at(13) - 50.0).abs() < 1e-9);
        assert!((at(99) - 20.0).abs() < 1e-9);
    }

    #[test]
    fn files_that_robots_see_keep_their_length() {
        let mut body = Body::new(2_000_000_000, 80.0);
        let (memory, cpu) = (meminfo(&body), stat(&body, Duration::ZERO));
        body.memory_available_bytes = 7;
        body.busy_ticks = 12345.0;
        assert_eq!(meminfo(&body).len(), memory.len());
        assert_eq!(stat(&body, Duration::from_secs(5000)).len(), cpu.len());
        assert!(memory.contains("MemTotal:            1953125 kB"), "{memory}");
    }
}
