//! Figures of the robot and of what runs on it: the first step of a report's path.
//!
//! One thread samples /proc, the radio and the sensors; it sleeps in between and is woken
//! when a component changes its state, so that memory is fresh exactly when it matters.

pub(crate) mod host;
mod ports;
pub(crate) mod process;
mod radio;
mod sampler;
mod sensors;
mod watch;

use std::io;
use std::thread::{self, JoinHandle};
use std::time::Duration;

use sdr_core::{
    input::Input,
    recording::RobotMetrics,
    report::HostReport,
    time::Instant,
    units::{Bytes, Permille},
};
use tokio::sync::mpsc;

use crate::clock;
use crate::record::{RecordSender, stamp};
pub(crate) use ports::SensorPorts;
pub(crate) use radio::Radio;
use sampler::{Sample, Sampler};
pub(crate) use sensors::{Sensors, Source};
pub(crate) use watch::Watch;

/// Time between two reports of unchanged instances.
const USAGE_PERIOD: Duration = Duration::from_secs(1);

/// Samples whose mean counts as what others use of the CPU.
const SAMPLES_KEPT: u32 = 32;

/// What is sampled, and how often.
#[derive(Clone, Debug)]
pub(crate) struct MetricsConfig {
    /// Time between two samples.
    pub(crate) period: Duration,
    /// What components may use in all.
    pub(crate) memory_capacity: Bytes,
    /// What of the machine's memory is not for components, when all the rest is: then what
    /// other programs use counts, too. `None` when robot.toml gives the capacity.
    pub(crate) memory_reserve: Option<Bytes>,
    /// Whether the machine's CPU use counts, not only that of the agent's tree.
    pub(crate) all_cpu: bool,
    /// Where the radio level is read.
    pub(crate) radio: Option<Radio>,
    /// Where the rest is read.
    pub(crate) sensors: Sensors,
}

/// The sampling thread.
#[derive(Debug)]
pub(crate) struct Metrics {
    watch: Watch,
    thread: Option<JoinHandle<()>>,
}

impl Metrics {
    /// Starts sampling; figures go to `inputs` and into the recording.
    pub(crate) fn start(
        config: MetricsConfig,
        watch: Watch,
        inputs: mpsc::Sender<Input>,
        record: RecordSender,
    ) -> io::Result<Self> {
        let sampler = Sampler::new()?;
        let machine = host::Machine::new(clock::now());
        let cpu_other = Permille(0);
        let desk =
            Desk { config, watch: watch.clone(), inputs, record, sampler, machine, cpu_other };
        let thread = thread::Builder::new().name("metrics".into()).spawn(move || desk.run())?;
        Ok(Self { watch, thread: Some(thread) })
    }
}

impl Drop for Metrics {
    fn drop(&mut self) {
        self.watch.close();
        if let Some(thread) = self.thread.take() {
            // A panic of the thread was printed already.
            let _ = thread.join();
        }
    }
}

struct Desk {
    config: MetricsConfig,
    watch: Watch,
    inputs: mpsc::Sender<Input>,
    record: RecordSender,
    sampler: Sampler,
    machine: host::Machine,
    cpu_other: Permille,
}

impl Desk {
    fn run(mut self) {
        let mut sample_at = clock::now();
        let mut usage_at = clock::now();
        while let Some(round) = self.watch.wait(sample_at) {
            let now = clock::now();
            if now >= sample_at {
                // A late thread does not catch up with a burst.
                sample_at = (sample_at + self.config.period).max(now);
            }
            let changed = !round.changed.is_empty();
            let sample = self.sampler.sample(now, &round);
            self.watch.keep(&sample.usage);
            let host = self.report_host(&sample);
            // A full queue means that the loop is busy; the next sample is near.
            let _ = self.inputs.try_send(Input::Host(host));
            if changed || sample.moved || now >= usage_at {
                let _ = self.inputs.try_send(Input::Usage(sample.usage.clone()));
            }
            if now >= usage_at {
                usage_at = now + USAGE_PERIOD;
                self.watch.record_all(&self.record);
            }
        }
    }

    fn report_host(&mut self, sample: &Sample) -> HostReport {
        let now = clock::now();
        let (memory_used, cpu_used) = (self.memory_used(sample), self.cpu_used(now, sample));
        self.cpu_other = mean(self.cpu_other, cpu_used.less(sample.cpu));
        let host = HostReport {
            memory_used,
            cpu_used,
            memory_other: memory_used.less(sample.memory),
            cpu_other: self.cpu_other,
            battery: self.config.sensors.battery(now),
            rssi: self.config.radio.as_ref().and_then(Radio::level),
            position: self.config.sensors.position(now),
        };
        let now_ns = now.as_nanos();
        self.record.record(now_ns, &self.message(now_ns, &host, sample));
        host
    }

    fn memory_used(&mut self, sample: &Sample) -> Bytes {
        let Some(reserve) = self.config.memory_reserve else { return sample.memory };
        let available = self.machine.memory_available();
        host::memory_used(self.config.memory_capacity, sample.memory, available, reserve)
    }

    fn cpu_used(&mut self, now: Instant, sample: &Sample) -> Permille {
        if !self.config.all_cpu {
            return sample.cpu;
        }
        // The two are measured at different moments: whatever is more is true.
        self.machine.cpu_used(now).max(sample.cpu)
    }

    #[expect(clippy::cast_precision_loss, reason = "metres and per cent for plots")]
    fn message(&self, now: u64, host: &HostReport, sample: &Sample) -> RobotMetrics {
        let metres = |mm: i32| mm as f32 / 1000.0;
        RobotMetrics {
            stamp: stamp(),
            monotonic_ns: now,
            robot: self.record.robot().into(),
            memory_capacity_bytes: self.config.memory_capacity.0,
            memory_free_bytes: self.config.memory_capacity.less(host.memory_used).0,
            memory_used_bytes: host.memory_used.0,
            cpu_permille: host.cpu_used.0,
            battery_percent: host.battery.map_or(f32::NAN, |battery| battery.0 as f32 / 10.0),
            rssi_dbm: host.rssi.map_or(f32::NAN, |rssi| f32::from(rssi.tenths()) / 10.0),
            x_m: host.position.map_or(f32::NAN, |position| metres(position.x_mm)),
            y_m: host.position.map_or(f32::NAN, |position| metres(position.y_mm)),
            agent_rss_bytes: sample.agent_resident.0,
            agent_pss_bytes: sample.agent_memory.0,
            agent_cpu_permille: sample.agent_cpu.0,
        }
    }
}

/// The mean of the last samples, some seconds of them: a burst of others is no reason to place
/// anything differently.
fn mean(before: Permille, now: Permille) -> Permille {
    Permille((before.0 * (SAMPLES_KEPT - 1) + now.0) / SAMPLES_KEPT)
}
