//! Meshes alone in virtual time, joined by a radio that loses.

use std::{
    cmp::Reverse,
    collections::{BTreeMap, BinaryHeap},
    net::SocketAddr,
    time::Duration,
};

use sdr_core::{
    id::RobotId,
    mesh::{FleetRecord, FleetTable, Incarnation, Mesh, MeshConfig, Push},
    report::{HostReport, Report},
    rng::Rng,
    time::Instant,
    units::{Bytes, Permille},
};

/// UDP and IP headers and the seal of one datagram.
pub(crate) const OVERHEAD_BYTES: u64 = 28 + 32;
/// As the brain has it: a handler that was not called for so long was itself paused.
const PAUSE_MIN: Duration = Duration::from_millis(800);
/// Each robot has new figures so often.
const HOST_PERIOD: Duration = Duration::from_secs(1);

/// One mesh and what it was charged with.
pub(crate) struct Robot {
    pub(crate) mesh: Mesh,
    pub(crate) bytes: u64,
    handled_at: Instant,
    host_at: Instant,
    tick_at: Instant,
}

enum Event {
    Tick(usize),
    Arrive { to: usize, from: usize, bytes: Vec<u8> },
}

/// A fleet; everything is drawn from one seed.
pub(crate) struct Fleet {
    pub(crate) robots: Vec<Robot>,
    pub(crate) now: Instant,
    pub(crate) loss_permille: usize,
    names: BTreeMap<RobotId, usize>,
    rng: Rng,
    queue: BinaryHeap<Reverse<(Instant, u64)>>,
    events: BTreeMap<u64, Event>,
    number: u64,
}

impl Fleet {
    pub(crate) fn new(count: usize, seed: u64) -> Self {
        let mut fleet = Self {
            robots: Vec::new(),
            now: Instant::ZERO,
            loss_permille: 0,
            names: (0..count).map(|number| (name(number), number)).collect(),
            rng: Rng::new(seed),
            queue: BinaryHeap::new(),
            events: BTreeMap::new(),
            number: 0,
        };
        for number in 0..count {
            let robot = fleet.robot(number, count);
            fleet.robots.push(robot);
            fleet.schedule_tick(number);
        }
        fleet
    }

    fn robot(&mut self, number: usize, count: usize) -> Robot {
        // some know two seeds only; the others are found
        let seeds = (0..8).map(|_| address(self.rng.below(count))).collect();
        let config = MeshConfig {
            robot: name(number),
            fleet: 7,
            seeds,
            group: None,
            listen: Some(address(number)),
            period: Duration::from_millis(350),
            gone_after: Duration::from_millis(11_500),
        };
        let nonce = u32::try_from(self.rng.below(1 << 30)).expect("30 bits");
        let own = Incarnation { counter: 1, nonce };
        let mesh = Mesh::new(config, own, FleetTable::default(), &[], self.now);
        let phase = |rng: &mut Rng, of: Duration| {
            of * u32::try_from(rng.below(1000)).expect("small") / 1000
        };
        Robot {
            mesh,
            bytes: 0,
            handled_at: self.now,
            host_at: self.now + phase(&mut self.rng, HOST_PERIOD),
            tick_at: self.now,
        }
    }

    pub(crate) fn number_of(&self, robot: &RobotId) -> usize {
        self.names[robot]
    }

    /// Robot `number` makes a shared record and says so at once.
    pub(crate) fn publish(&mut self, number: usize, record: FleetRecord) {
        self.robots[number].mesh.publish(vec![record]);
        self.after(number);
    }

    /// Runs until `time` has passed.
    pub(crate) fn run(&mut self, time: Duration) {
        let end = self.now + time;
        self.run_until(end, |_| false);
    }

    /// Runs until `end`, or until `done` at one of the steps of 10 ms.
    pub(crate) fn run_until(&mut self, end: Instant, done: impl Fn(&Self) -> bool) {
        let mut look_at = self.now;
        while let Some(Reverse((at, _))) = self.queue.peek().copied().filter(|e| e.0.0 <= end) {
            if at >= look_at {
                look_at = at + Duration::from_millis(10);
                if done(self) {
                    return;
                }
            }
            let Some(Reverse((at, number))) = self.queue.pop() else { return };
            self.now = at;
            if let Some(event) = self.events.remove(&number) {
                self.happen(event);
            }
        }
        self.now = end;
    }

    fn happen(&mut self, event: Event) {
        match event {
            Event::Tick(number) => {
                let now = self.now;
                let robot = &mut self.robots[number];
                if now < robot.tick_at {
                    return;
                }
                robot.wake(now);
                self.after(number);
            }
            Event::Arrive { to, from, bytes } => {
                let now = self.now;
                self.robots[to].wake(now);
                self.robots[to].mesh.handle_datagram(now, address(from), &bytes);
                self.after(to);
            }
        }
    }

    /// As the brain does: the tick, then everything that is to be said.
    fn after(&mut self, number: usize) {
        let now = self.now;
        let robot = &mut self.robots[number];
        if now >= robot.host_at {
            robot.host_at = now + HOST_PERIOD;
            let used = Bytes::mega(500 + self.rng.below(50) as u64);
            let cpu = Permille(u32::try_from(self.rng.below(400)).expect("small"));
            let host = HostReport { memory_used: used, cpu_used: cpu, ..HostReport::default() };
            robot.mesh.report(&Report::Host(host), Push::WithGossip);
        }
        robot.mesh.handle_tick(now);
        while robot.mesh.poll_news().is_some() {}
        let mut flying = Vec::new();
        while let Some((to, bytes)) = robot.mesh.poll_send() {
            robot.bytes += bytes.len() as u64 + OVERHEAD_BYTES;
            flying.push((to, bytes));
        }
        for (to, bytes) in flying {
            let lost = self.rng.below(1000) < self.loss_permille;
            if lost {
                continue;
            }
            let to = usize::from(to.port()) - 1000;
            let delay = Duration::from_micros(500 + self.rng.below(9500) as u64);
            self.schedule(now + delay, Event::Arrive { to, from: number, bytes });
        }
        self.schedule_tick(number);
    }

    fn schedule_tick(&mut self, number: usize) {
        let due = self.robots[number].mesh.next_deadline().max(self.now);
        let robot = &mut self.robots[number];
        if robot.tick_at <= self.now || due < robot.tick_at {
            robot.tick_at = due;
            self.schedule(due, Event::Tick(number));
        }
    }

    fn schedule(&mut self, at: Instant, event: Event) {
        self.number += 1;
        self.queue.push(Reverse((at, self.number)));
        self.events.insert(self.number, event);
    }
}

impl Robot {
    fn wake(&mut self, now: Instant) {
        let pause = now.since(self.handled_at);
        if pause >= PAUSE_MIN {
            self.mesh.forgive_pause(pause);
        }
        self.handled_at = now;
    }
}

pub(crate) fn name(number: usize) -> RobotId {
    RobotId::new(&format!("robot-{number}")).expect("a name")
}

fn address(number: usize) -> SocketAddr {
    let port = 1000 + u16::try_from(number).expect("fleets are small");
    SocketAddr::from(([10, 0, 0, 1], port))
}
