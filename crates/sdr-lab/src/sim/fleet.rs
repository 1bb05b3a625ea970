//! The fleet in virtual time: robots, radio, and what is due.

use std::{collections::BTreeMap, sync::Arc, time::Duration};

use sdr_core::{
    api::DeployAnswer,
    brain::{Brain, BrainConfig},
    event::Event,
    id::{ComponentKey, RobotId},
    input::{Input, InstanceId},
    order::Token,
    time::Instant,
};

use super::{
    air::Air,
    chance::Chance,
    disk::Written,
    due::Due,
    pool::Pool,
    process::Process,
    queue::Queue,
    robot::{Robot, body},
    setup::Setup,
    sight::Sight,
    tally::Tally,
    trace::Trace,
};

/// A timer is never closer than this: clocks of machines are no finer.
const TIMER_MIN: Duration = Duration::from_micros(100);
/// Datagrams that the socket of a robot holds while its loop stands still.
const BACKLOG_MAX: usize = 256;
/// The first moment; before it there is nothing.
pub(crate) const BEGIN: Instant = Instant::from_millis(1000);

/// An active process.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct ActiveProcess {
    /// Where.
    pub robot: usize,
    /// Which process there.
    pub instance: InstanceId,
    /// Under which token.
    pub token: Token,
}

/// Hands inputs to brains in place of the fleet, to measure what they take.
pub trait Probe {
    /// Calls `brain.handle(now, input)`, once.
    fn handle(&mut self, brain: &mut Brain, now: Instant, input: Input);
}

/// A fleet: `robot-1`, `robot-2`, ... in virtual time, on one thread.
pub struct Fleet {
    /// The present.
    pub now: Instant,
    /// By number, from 0.
    pub robots: Vec<Robot>,
    pub(crate) setup: Setup,
    pub(crate) queue: Queue<Due>,
    pub(crate) air: Air,
    pub(crate) chance: Chance,
    pub(crate) trace: Trace,
    /// Figures so far.
    pub tally: Tally,
    pub(crate) sights: Vec<Sight>,
    pub(crate) keys: Vec<ComponentKey>,
    pub(crate) numbers: BTreeMap<ComponentKey, usize>,
    pub(crate) words: BTreeMap<String, usize>,
    pub(crate) actives: Vec<Vec<ActiveProcess>>,
    /// Consumers by the number of the component that feeds them.
    pub(crate) feeds: Vec<Vec<(usize, InstanceId)>>,
    pub(crate) flowing: Vec<bool>,
    pub(crate) requests: u64,
    pub(crate) cuts: u64,
    /// The latest end of a disturbance so far; may lie ahead.
    pub(crate) steady_since: Instant,
    /// What brains said, when it is kept: when, who, what.
    pub told: Vec<(Instant, usize, Event)>,
    /// Answers to operators, when they are kept: who, what.
    pub answers: Vec<(usize, Result<DeployAnswer, String>)>,
    /// Faults that struck, in words, when they are kept.
    pub struck: Vec<(Instant, String)>,
    probe: Option<Box<dyn Probe>>,
    /// What all brains hold in common, once.
    pub(crate) pool: Arc<Pool>,
    gone_after: Duration,
    steps: u64,
}

impl Fleet {
    /// A fleet whose robots are all off.
    pub fn new(setup: Setup) -> Self {
        let mut chance = Chance::stream(setup.seed, 1);
        let words: Vec<&str> = setup.words.iter().map(String::as_str).collect();
        let robots = (0..setup.robots).map(|number| {
            let drift = chance.below(2 * setup.drift_ppm_max + 1);
            let drift =
                i64::try_from(drift).unwrap_or(0) - i64::try_from(setup.drift_ppm_max).unwrap_or(0);
            Robot::new(number, body(setup.memory, setup.cpu, &words), drift)
        });
        let robots: Vec<Robot> = robots.collect();
        let air = Air::new(setup.robots, setup.weather.clone(), Chance::stream(setup.seed, 2));
        let first = &robots[0];
        let config = BrainConfig::new(first.id.clone(), first.facts.clone());
        Self {
            gone_after: config.gone_after,
            now: BEGIN,
            tally: Tally::new(robots.len()),
            robots,
            queue: Queue::new(),
            air,
            chance,
            trace: Trace::new(),
            sights: Vec::new(),
            keys: Vec::new(),
            numbers: BTreeMap::new(),
            words: BTreeMap::new(),
            actives: Vec::new(),
            feeds: Vec::new(),
            flowing: Vec::new(),
            requests: 0,
            cuts: 0,
            steady_since: BEGIN,
            told: Vec::new(),
            answers: Vec::new(),
            struck: Vec::new(),
            probe: None,
            pool: Arc::new(Pool::default()),
            steps: 0,
            setup,
        }
    }

    /// Does the next thing due at `end` or before; false when there is none.
    pub fn step(&mut self, end: Instant) -> bool {
        let Some((at, due)) = self.queue.pop_until(end) else {
            self.now = self.now.max(end);
            return false;
        };
        self.now = self.now.max(at);
        self.steps += 1;
        match due {
            Due::Wake { robot } => self.wake(robot),
            Due::Datagram { to, from, bytes } => self.deliver(to, from, bytes),
            Due::Input { robot, life, input } if self.lives(robot, life) => self.tell(robot, input),
            Due::Turn { robot, life, instance, turn } if self.lives(robot, life) => {
                self.turn(robot, instance, turn);
            }
            Due::Stored { robot, life } if self.lives(robot, life) => self.stored(robot),
            Due::Transfer(transfer) => self.transferred(transfer),
            Due::Crash { robot, life, down } if self.lives(robot, life) => {
                self.crash(robot, down, super::fault::DiskFate::Kept);
            }
            Due::Start { robot } if !self.robots[robot].is_on() => self.switch_on(robot),
            Due::Sample { robot, life } if self.lives(robot, life) => self.sample(robot),
            Due::Flow { component } => self.flow(component),
            Due::Fault(fault) => self.strike(&fault),
            Due::Over(over) => self.end_fault(over),
            Due::Input { .. }
            | Due::Turn { .. }
            | Due::Stored { .. }
            | Due::Crash { .. }
            | Due::Start { .. }
            | Due::Sample { .. } => {}
        }
        true
    }

    /// Lets time pass.
    pub fn run(&mut self, time: Duration) {
        let end = self.now + time;
        while self.step(end) {}
    }

    /// How many things were done so far.
    pub fn steps(&self) -> u64 {
        self.steps
    }

    /// How many things are due: datagrams under way, timers, outcomes.
    pub fn due(&self) -> usize {
        self.queue.len()
    }

    /// Time since the beginning.
    pub fn age(&self) -> Duration {
        self.now.since(BEGIN)
    }

    /// Hash of everything that happened so far.
    pub fn trace_hash(&self) -> u64 {
        self.trace.hash()
    }

    /// What was seen since the last call.
    pub fn take_sights(&mut self) -> Vec<Sight> {
        std::mem::take(&mut self.sights)
    }

    /// Whether something was seen since the last call of [`Fleet::take_sights`].
    pub fn has_sights(&self) -> bool {
        !self.sights.is_empty()
    }

    /// How the fleet was set up.
    pub fn setup(&self) -> &Setup {
        &self.setup
    }

    /// Where the robots stand, metres from the middle; empty when places do not matter.
    pub fn place(&mut self, places: Vec<(f64, f64)>) {
        self.air.place(places);
        for robot in 0..self.robots.len() {
            self.robots[robot].host.rssi = self.level_of(robot);
        }
    }

    /// Lets `probe` hand inputs over from now on.
    pub fn probe(&mut self, probe: Box<dyn Probe>) {
        self.probe = Some(probe);
    }

    /// Whether what a robot stores is kept for its next start.
    pub fn keep_disk(&mut self, robot: usize, keep: bool) {
        self.robots[robot].disk.is_read = keep;
    }

    /// Silence after which a robot counts as gone, as brains have it by default.
    pub fn gone_after(&self) -> Duration {
        self.gone_after
    }

    /// Starts a robot's agent from what is on its disk.
    pub fn switch_on(&mut self, robot: usize) {
        // Monotonic clocks begin anew with their machine, anywhere.
        let shown = Instant::from_millis(1000 + self.chance.bits() % 1_000_000_000);
        self.robots[robot].start(self.now, shown, self.setup.robots, &self.pool);
        let disk_kept = self.robots[robot].disk.held().is_some();
        self.disturb(self.now);
        self.sights.push(Sight::On { robot, disk_kept });
        self.carry_out(robot);
        self.set_wake(robot);
        let life = self.robots[robot].life;
        let first = self.chance.time(Duration::ZERO, self.setup.host_period);
        self.queue.push(self.now + first, Due::Sample { robot, life });
    }

    /// The robot vanishes: agent, processes, radio.
    pub fn switch_off(&mut self, robot: usize) {
        let written = match self.chance.happens(0.5) {
            true => Written::Whole,
            false => Written::NotAtAll,
        };
        self.robots[robot].disk.crash(written);
        let processes = self.robots[robot].stop(self.now);
        for (instance, process) in processes {
            self.forget(robot, instance, &process);
        }
        self.disturb(self.now);
        self.sights.push(Sight::Off { robot });
    }

    /// Tells a brain something, at once or when its loop goes on.
    pub fn tell(&mut self, number: usize, input: Input) {
        let robot = &mut self.robots[number];
        let Some(brain) = &mut robot.brain else { return };
        if self.now < robot.paused_until {
            let due = Due::Input { robot: number, life: robot.life, input };
            return self.queue.push(robot.paused_until, due);
        }
        let shown = robot.clock.show(self.now);
        match &mut self.probe {
            Some(probe) => probe.handle(brain, shown, input),
            None => brain.handle(shown, input),
        }
        self.tally.handled += 1;
        self.carry_out(number);
        self.set_wake(number);
    }

    pub(crate) fn lives(&self, robot: usize, life: u64) -> bool {
        self.robots[robot].is_on() && self.robots[robot].life == life
    }

    pub(crate) fn set_wake(&mut self, number: usize) {
        let robot = &mut self.robots[number];
        let Some(deadline) = robot.brain.as_ref().and_then(|brain| brain.next_deadline()) else {
            return;
        };
        let at = robot.clock.when(deadline).max(self.now + TIMER_MIN).max(robot.paused_until);
        if robot.wake_at.is_none_or(|before| at < before) {
            robot.wake_at = Some(at);
            self.queue.push(at, Due::Wake { robot: number });
        }
    }

    fn wake(&mut self, number: usize) {
        let robot = &mut self.robots[number];
        if robot.wake_at != Some(self.now) {
            return;
        }
        robot.wake_at = None;
        let shown = robot.clock.show(self.now);
        let due = robot.brain.as_ref().and_then(|brain| brain.next_deadline());
        match due.is_some_and(|deadline| deadline <= shown) {
            true => self.tell(number, Input::Tick),
            false => self.set_wake(number),
        }
    }

    fn deliver(&mut self, to: usize, from: usize, bytes: Vec<u8>) {
        let robot = &mut self.robots[to];
        if self.now < robot.paused_until {
            robot.backlog += 1;
            if robot.backlog > BACKLOG_MAX {
                return;
            }
        } else {
            robot.backlog = 0;
        }
        self.tally.received(to, bytes.len() + super::air::FRAME_BYTES);
        self.tell(to, Input::Datagram { from: super::air::address(from), bytes });
    }

    /// Something beside the usual goes on until `until`.
    pub(crate) fn disturb(&mut self, until: Instant) {
        self.steady_since = self.steady_since.max(until);
    }

    /// The number of a component; a new one when it was never seen.
    pub(crate) fn number(&mut self, key: &ComponentKey) -> usize {
        if let Some(number) = self.numbers.get(key) {
            return *number;
        }
        let number = self.keys.len();
        self.keys.push(key.clone());
        self.numbers.insert(key.clone(), number);
        self.words.insert(format!("{}/{}", key.system, key.name), number);
        self.actives.push(Vec::new());
        self.feeds.push(Vec::new());
        self.flowing.push(false);
        number
    }

    /// The key of a component by number.
    pub fn key(&self, component: usize) -> &ComponentKey {
        &self.keys[component]
    }

    /// Active processes of a component.
    pub fn active(&self, key: &ComponentKey) -> &[ActiveProcess] {
        self.numbers.get(key).map_or(&[], |number| &self.actives[*number])
    }

    /// The number of a robot by name.
    pub fn robot_number(&self, id: &RobotId) -> Option<usize> {
        let number = id.as_str().strip_prefix("robot-")?.parse::<usize>().ok()?;
        number.checked_sub(1).filter(|number| *number < self.robots.len())
    }

    pub(crate) fn forget(&mut self, robot: usize, instance: InstanceId, process: &Process) {
        let component = process.number;
        let before = self.actives[component].len();
        self.actives[component].retain(|a| (a.robot, a.instance) != (robot, instance));
        if self.actives[component].len() < before {
            self.sights.push(Sight::Inactive { robot, instance, component });
        }
        for (_, producer) in &process.inputs {
            self.feeds[*producer].retain(|consumer| *consumer != (robot, instance));
        }
    }
}
