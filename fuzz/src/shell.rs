//! A brain with a shell that answers each order at once: what an input leads to is part of
//! what is tried.

use std::time::Duration;

use sdr_core::{
    brain::{Brain, BrainConfig, Seams},
    effect::{Command, Effect, StoredState},
    input::{Input, InstanceId, InstanceNews},
    lifecycle::LifecycleState,
    order::Token,
    report::{HostReport, RobotFacts},
    spec::launch_hash,
    time::Instant,
    units::{Bytes, Permille},
};

use crate::fleet;

/// Effects that one input may have before it counts as a flood.
const EFFECTS_MAX: usize = 20_000;
/// Executables that this robot has.
pub const WORDS: [&str; 3] = ["camera", "anomaly", "controller"];

/// One robot alone.
pub struct Shell {
    /// Its decisions.
    pub brain: Box<Brain>,
    now: Instant,
    waiting: Vec<Input>,
    /// Answers to operators.
    pub answers: usize,
    /// Processes started.
    pub launched: usize,
    /// What others give who are asked for a blob.
    pub gift: Vec<u8>,
    fetches: usize,
}

/// What the robot under test is told at its start.
pub fn config() -> BrainConfig {
    let facts = RobotFacts {
        memory_capacity: Bytes::mega(1900),
        cpu_capacity: Permille(4000),
        labels: vec!["red".into()],
        devices: Vec::new(),
        launchables: {
            let mut hashes = WORDS.map(launch_hash).to_vec();
            hashes.sort_unstable();
            hashes
        },
        role: Default::default(),
        api: String::new(),
        version: String::new(),
    };
    BrainConfig { fleet: fleet::NAME.into(), seed: 7, ..BrainConfig::new(fleet::robot(0), facts) }
}

/// What other crates fill in, as in the agent.
pub fn seams() -> Seams {
    Seams {
        recovery: Box::new(sdr_recovery::make),
        allocation: Box::new(sdr_alloc::check),
        commons: None,
    }
}

impl Shell {
    /// A robot that starts with this on its disk.
    pub fn new(stored: Option<StoredState>) -> Self {
        let now = Instant::from_millis(1000);
        let brain = Brain::new(config(), seams(), stored, now);
        let mut shell = Self {
            brain,
            now,
            waiting: Vec::new(),
            answers: 0,
            launched: 0,
            gift: Vec::new(),
            fetches: 0,
        };
        shell.drain();
        shell
    }

    /// A robot that has waited for others long enough.
    pub fn settled() -> Self {
        let mut shell = Self::new(None);
        shell.pass(Duration::from_secs(8));
        shell
    }

    /// Tells it something, and all that comes of it.
    pub fn tell(&mut self, input: Input) {
        self.waiting.push(input);
        self.drain();
    }

    /// Lets time pass, as its timers ask for it.
    pub fn pass(&mut self, time: Duration) {
        let end = self.now + time;
        for _ in 0..400 {
            let due = self.brain.next_deadline().unwrap_or(end).min(end);
            self.now = due.max(self.now + Duration::from_millis(1));
            if self.now >= end {
                break;
            }
            self.tell(Input::Host(HostReport::default()));
        }
        self.now = self.now.max(end);
        self.tell(Input::Tick);
    }

    fn drain(&mut self) {
        let mut effects = 0;
        loop {
            while let Some(effect) = self.brain.poll_effect() {
                effects += 1;
                assert!(effects <= EFFECTS_MAX, "more than {EFFECTS_MAX} effects of one input");
                self.carry_out(effect);
            }
            if self.waiting.is_empty() {
                return;
            }
            let input = self.waiting.remove(0);
            self.now = self.now + Duration::from_micros(100);
            self.brain.handle(self.now, input);
        }
    }

    fn carry_out(&mut self, effect: Effect) {
        match effect {
            Effect::Send { bytes, .. } => assert!(bytes.len() <= 1200),
            Effect::Store { ticket, .. } => self.waiting.push(Input::Stored { ticket }),
            Effect::Fetch { blob, .. } => {
                assert!(blob.is_allowed());
                self.fetches += 1;
                let bytes = match self.fetches % 2 {
                    1 => Err("nobody has it".into()),
                    _ => Ok(self.gift.clone()),
                };
                self.waiting.push(Input::Fetched { blob, result: bytes });
            }
            Effect::Launch(order) => {
                self.launched += 1;
                let instance = order.instance;
                self.news(instance, InstanceNews::Started { pid: 4711 });
                self.is(instance, LifecycleState::Inactive, None);
            }
            Effect::Command { instance, command } => match command {
                Command::Activate(token) => {
                    self.is(instance, LifecycleState::Active, Some(token));
                }
                Command::Deactivate | Command::Reset => {
                    self.is(instance, LifecycleState::Inactive, None);
                }
                Command::Patience(_) => {}
                Command::Finish | Command::Kill => {
                    self.news(instance, InstanceNews::Exited { reason: "told".into() });
                }
            },
            Effect::Plan { plan, problem } => {
                let result = sdr_alloc::allocate(&problem);
                self.waiting.push(Input::Planned { plan, result });
            }
            Effect::Ask(order) => {
                let result = Err("no such program".into());
                self.waiting.push(Input::Told { question: order.question, result });
            }
            Effect::Answer { .. } => self.answers += 1,
            Effect::Routes(_) | Effect::Event(_) => {}
        }
    }

    fn is(&mut self, instance: InstanceId, state: LifecycleState, token: Option<Token>) {
        self.news(instance, InstanceNews::State { state, token, fault: None });
    }

    fn news(&mut self, instance: InstanceId, news: InstanceNews) {
        self.waiting.push(Input::Instance { instance, news });
    }
}
