//! One robot: a brain, its disk, its processes, and what is due.

use std::{
    collections::{BTreeMap, VecDeque},
    net::SocketAddr,
    time::Duration,
};

use sdr_core::{
    api::{DeployAnswer, StatusView},
    brain::{Brain, BrainConfig, Seams},
    effect::{Command, Direction, Effect, LaunchOrder, Route, StoredState},
    event::Event,
    id::RobotId,
    input::{Input, InstanceId, InstanceNews},
    lifecycle::LifecycleState,
    order::Token,
    recover::Cause,
    report::{HostReport, RobotFacts, RolePreference, Usage},
    spec::launch_hash,
    time::Instant,
    units::{Bytes, Permille},
};

use super::{
    process::{Behaviour, Output, Process},
    wire::address,
};

/// Time a store takes.
const STORE: Duration = Duration::from_millis(3);
/// Time a small thing takes.
const SOON: Duration = Duration::from_millis(2);

/// One robot of the harness.
pub struct Robot {
    /// Its name.
    pub id: RobotId,
    /// What it measures.
    pub host: HostReport,
    /// Its body and limits.
    pub facts: RobotFacts,
    /// Everything it said happened.
    pub events: Vec<(Instant, Event)>,
    /// Answers to its API clients.
    pub answers: Vec<Result<DeployAnswer, String>>,
    /// How processes of a component (by name) behave here.
    pub behaviours: BTreeMap<String, Behaviour>,
    /// Stores fail from now on.
    pub disk_broken: bool,
    /// Starts of processes so far.
    pub launches: usize,
    disk: Option<StoredState>,
    brain: Option<Box<Brain>>,
    seeds: Vec<SocketAddr>,
    number: usize,
    starts: u64,
    due: BTreeMap<(Instant, u64), Input>,
    count: u64,
    processes: BTreeMap<InstanceId, Process>,
    routes: Vec<Route>,
    sent: VecDeque<(SocketAddr, Vec<u8>)>,
}

impl Robot {
    pub(super) fn new(number: usize, robots: usize, memory: Bytes) -> Self {
        let words = ["fisheye", "anomaly", "camera", "controller", "position", "worker"];
        let mut launchables: Vec<u32> = words.map(launch_hash).into();
        launchables.sort_unstable();
        let facts = RobotFacts {
            memory_capacity: memory,
            cpu_capacity: Permille(4000),
            labels: Vec::new(),
            devices: Vec::new(),
            launchables,
            role: RolePreference::Able,
            api: String::new(),
            version: "test".into(),
        };
        Self {
            id: RobotId::new(&format!("robot-{}", number + 1)).expect("a name"),
            host: HostReport { memory_used: Bytes::mega(12), ..HostReport::default() },
            facts,
            events: Vec::new(),
            answers: Vec::new(),
            behaviours: BTreeMap::new(),
            disk_broken: false,
            launches: 0,
            disk: None,
            brain: None,
            seeds: (0..robots).map(address).collect(),
            number,
            starts: 0,
            due: BTreeMap::new(),
            count: 0,
            processes: BTreeMap::new(),
            routes: Vec::new(),
            sent: VecDeque::new(),
        }
    }

    pub(super) fn switch_on(&mut self, now: Instant) {
        self.starts += 1;
        let config = BrainConfig {
            seeds: self.seeds.clone(),
            listen: Some(address(self.number)),
            seed: (self.starts << 40) ^ (self.number as u64) << 33,
            ..BrainConfig::new(self.id.clone(), self.facts.clone())
        };
        let seams = Seams { recovery: Box::new(sdr_recovery::make) };
        self.brain = Some(Brain::new(config, seams, self.disk.clone(), now));
        self.carry_out(now);
    }

    pub(super) fn switch_off(&mut self) {
        self.brain = None;
        self.processes.clear();
        self.due.clear();
        self.routes.clear();
        self.sent.clear();
    }

    /// Whether its agent runs.
    pub fn is_on(&self) -> bool {
        self.brain.is_some()
    }

    /// Forgets everything on disk.
    pub fn wipe_disk(&mut self) {
        self.disk = None;
    }

    /// What it believes.
    pub fn status(&self, now: Instant) -> StatusView {
        self.brain.as_ref().expect("the robot is on").status(now)
    }

    /// Whether it believes that it is the coordinator.
    pub fn is_coordinator(&self, now: Instant) -> bool {
        self.is_on() && self.status(now).coordinator.as_deref() == Some(self.id.as_str())
    }

    /// Kills the processes of a component.
    pub fn kill(&mut self, now: Instant, component: &str) {
        let ids = self.ids_of(component);
        for instance in ids {
            self.exit(now, instance, "killed by signal 9");
        }
    }

    /// The execution thread of a component stops answering.
    pub fn hang(&mut self, now: Instant, component: &str) {
        for instance in self.ids_of(component) {
            let news = InstanceNews::Hung { reason: "no heartbeat for 1.0 s".into() };
            self.later(now, Input::Instance { instance, news });
        }
    }

    /// Processes that run on it.
    pub fn process_count(&self) -> usize {
        self.processes.len()
    }

    pub(super) fn has_active(&self, component: &str) -> bool {
        self.processes.values().any(|process| {
            process.component.name.as_str() == component && process.state == LifecycleState::Active
        })
    }

    pub(super) fn give(&mut self, now: Instant, input: Input) {
        let Some(brain) = &mut self.brain else { return };
        brain.handle(now, input);
        self.carry_out(now);
    }

    pub(super) fn next_due(&self) -> Option<Instant> {
        let brain = self.brain.as_ref()?;
        let first = self.due.keys().next().map(|(at, _)| *at);
        first.into_iter().chain(brain.next_deadline()).min()
    }

    pub(super) fn take_sent(&mut self) -> VecDeque<(SocketAddr, Vec<u8>)> {
        std::mem::take(&mut self.sent)
    }

    /// Does all that is due.
    pub(super) fn work(&mut self, now: Instant) {
        while let Some(entry) = self.due.first_entry() {
            if entry.key().0 > now {
                break;
            }
            let input = entry.remove();
            self.live(now, &input);
            self.give(now, input);
        }
        let tick = self.brain.as_ref().and_then(|brain| brain.next_deadline());
        if tick.is_some_and(|at| now >= at) {
            self.give(now, Input::Tick);
        }
    }

    pub(super) fn sample(&mut self, now: Instant) {
        let used: u64 = self.processes.len() as u64 * 530_000_000;
        let host = HostReport { memory_used: self.host.memory_used.plus(Bytes(used)), ..self.host };
        self.give(now, Input::Host(host));
        let usage = Usage { memory: Bytes::mega(512), cpu: Permille(50) };
        let figures = self.processes.keys().map(|id| (*id, usage)).collect();
        self.give(now, Input::Usage(figures));
    }

    pub(super) fn outputs(&self) -> Vec<Output> {
        let forwards = self.routes.iter().filter_map(|route| match &route.direction {
            Direction::Out { active } => Some((route.path.clone(), active.clone())),
            Direction::In => None,
        });
        let forwards: Vec<(String, Option<Token>)> = forwards.collect();
        let active = self.processes.values().filter(|p| p.state == LifecycleState::Active);
        active
            .filter_map(|process| {
                Some(Output {
                    robot: self.number,
                    component: process.component.clone(),
                    token: process.token.clone()?,
                    forwards: forwards.clone(),
                })
            })
            .collect()
    }

    /// A sample of `output` arrives where routes and fences let it.
    pub(super) fn offer_sample(&mut self, now: Instant, me: usize, output: &Output, linked: bool) {
        let taken: Vec<String> = self
            .routes
            .iter()
            .filter(|route| route.direction == Direction::In)
            .map(|route| route.path.clone())
            .collect();
        let mut heard = Vec::new();
        for (id, process) in &mut self.processes {
            if process.state != LifecycleState::Active {
                continue;
            }
            for wiring in &process.inputs {
                let from = format!("{}/{}/", output.component.system, output.component.name);
                let carried = output.robot == me
                    || (linked
                        && taken.contains(&wiring.path)
                        && output.forwards.iter().any(|(path, active)| {
                            *path == wiring.path && active.as_ref() == Some(&output.token)
                        }));
                if !wiring.path.starts_with(&from) || !carried {
                    continue;
                }
                match process.heard.get(&wiring.connection) {
                    Some(before) if *before > output.token => process.fenced += 1,
                    Some(before) if *before == output.token => {}
                    Some(_) | None => {
                        process.heard.insert(wiring.connection, output.token.clone());
                        heard.push((*id, wiring.connection));
                    }
                }
            }
        }
        for (instance, connection) in heard {
            let news = InstanceNews::Heard { connection, token: output.token.clone() };
            self.later(now, Input::Instance { instance, news });
        }
    }

    fn ids_of(&self, component: &str) -> Vec<InstanceId> {
        let of = self.processes.iter().filter(|(_, p)| p.component.name.as_str() == component);
        of.map(|(id, _)| *id).collect()
    }

    fn exit(&mut self, now: Instant, instance: InstanceId, reason: &str) {
        if self.processes.remove(&instance).is_some() {
            let news = InstanceNews::Exited { reason: reason.into() };
            self.later(now, Input::Instance { instance, news });
        }
    }

    fn later(&mut self, at: Instant, input: Input) {
        self.count += 1;
        self.due.insert((at, self.count), input);
    }

    /// What an arriving input means for the process itself.
    fn live(&mut self, now: Instant, input: &Input) {
        let Input::Instance { instance, news } = input else { return };
        let InstanceNews::State { state, token, .. } = news else { return };
        let Some(process) = self.processes.get_mut(instance) else { return };
        process.state = *state;
        process.token.clone_from(token);
        if *state != LifecycleState::Active {
            return;
        }
        let behaviour = self.behaviours.get(process.component.name.as_str()).cloned();
        let Some(behaviour) = behaviour else { return };
        if let Some(after) = behaviour.crash_after {
            let news = InstanceNews::Exited { reason: "exit status 1".into() };
            self.later(now + after, Input::Instance { instance: *instance, news });
        }
        if let Some((after, cause)) = behaviour.fail_after {
            let token = token.clone();
            let news = failed(token, cause);
            self.later(now + after, Input::Instance { instance: *instance, news });
        }
    }

    fn carry_out(&mut self, now: Instant) {
        while let Some(effect) = self.brain.as_mut().and_then(|brain| brain.poll_effect()) {
            match effect {
                Effect::Send { to, bytes } => self.sent.push_back((to, bytes)),
                Effect::Store { ticket, state } => {
                    let input = match self.disk_broken {
                        true => Input::StoreFailed { ticket, reason: "no space left".into() },
                        false => {
                            self.disk = Some(state);
                            Input::Stored { ticket }
                        }
                    };
                    self.later(now + STORE, input);
                }
                Effect::Launch(order) => self.launch(now, *order),
                Effect::Command { instance, command } => self.command(now, instance, command),
                Effect::Routes(routes) => self.route(now, routes),
                Effect::Plan { plan, problem } => {
                    let result = sdr_alloc::allocate(&problem);
                    self.later(now + SOON, Input::Planned { plan, result });
                }
                Effect::Answer { result, .. } => self.answers.push(result),
                Effect::Event(event) => self.events.push((now, event)),
            }
        }
    }

    fn launch(&mut self, now: Instant, order: LaunchOrder) {
        self.launches += 1;
        let behaviour = self.behaviours.get(order.component.name.as_str()).cloned();
        let behaviour = behaviour.unwrap_or_default();
        let instance = order.instance;
        if behaviour.unstartable {
            let news = InstanceNews::LaunchFailed { reason: "no such file".into() };
            return self.later(now + SOON, Input::Instance { instance, news });
        }
        let process = Process {
            component: order.component,
            inputs: order.inputs,
            state: LifecycleState::Created,
            token: None,
            heard: BTreeMap::new(),
            fenced: 0,
        };
        self.processes.insert(instance, process);
        let pid = u32::try_from(instance).expect("few instances");
        let started = InstanceNews::Started { pid };
        self.later(now + SOON, Input::Instance { instance, news: started });
        let news = state(LifecycleState::Inactive, None);
        self.later(now + behaviour.initialise, Input::Instance { instance, news });
    }

    fn command(&mut self, now: Instant, instance: InstanceId, command: Command) {
        let news = match command {
            Command::Activate(token) => state(LifecycleState::Active, Some(token)),
            Command::Deactivate | Command::Reset => state(LifecycleState::Inactive, None),
            Command::Finish | Command::Kill => {
                return self.exit(now + SOON, instance, "exit status 0");
            }
        };
        self.later(now + SOON, Input::Instance { instance, news });
    }

    fn route(&mut self, now: Instant, routes: Vec<Route>) {
        for route in &routes {
            let matched = u16::try_from(route.peers.len()).expect("few peers");
            let input = Input::Route { path: route.path.clone(), matched };
            self.later(now + Duration::from_millis(120), input);
        }
        self.routes = routes;
    }
}

fn state(state: LifecycleState, token: Option<Token>) -> InstanceNews {
    InstanceNews::State { state, token, fault: None }
}

fn failed(token: Option<Token>, cause: Cause) -> InstanceNews {
    let fault = Some((cause, String::from("the device is gone")));
    InstanceNews::State { state: LifecycleState::Error, token, fault }
}
