//! The shell of each simulated agent: carries effects out, and lets processes take their turns.

use std::time::Duration;

use sdr_core::{
    api::Accepted,
    effect::{Command, Effect, LaunchOrder, Route},
    input::{Input, InstanceId, InstanceNews},
    lifecycle::LifecycleState,
    order::Token,
    report::Usage,
};

use super::{
    air::{FRAME_BYTES, number_of},
    disk::Order,
    due::{Due, Turn},
    fleet::{ActiveProcess, Fleet},
    process::{Behaviour, Process},
    sight::Sight,
};

/// Time a small thing takes.
const SOON: Duration = Duration::from_millis(2);
/// Time until the endpoints of a new route have found each other.
const MATCHING: Duration = Duration::from_millis(120);
/// A process whose execution thread is silent for so long counts as hung.
const HUNG_AFTER: Duration = Duration::from_secs(1);

impl Fleet {
    /// Drains a brain after a `handle`.
    pub(crate) fn carry_out(&mut self, number: usize) {
        let mut effects = 0;
        while let Some(effect) = self.robots[number].brain.as_mut().and_then(|b| b.poll_effect()) {
            effects += 1;
            match effect {
                Effect::Send { to, bytes } => self.send(number, number_of(to), bytes),
                Effect::Store { ticket, change } => self.store(number, Order::new(ticket, change)),
                Effect::Fetch { blob, from } => self.fetch(number, blob, &from),
                Effect::Launch(order) => self.launch(number, *order),
                Effect::Command { instance, command } => self.command(number, instance, command),
                Effect::Routes(routes) => self.route(number, &routes),
                Effect::Plan { plan, problem } => {
                    self.trace.note(self.now, number, &[2]);
                    self.tally.replans += 1;
                    self.sights.push(Sight::Planned { robot: number });
                    let result = sdr_alloc::allocate(&problem);
                    self.later(number, SOON, Input::Planned { plan, result });
                }
                Effect::Ask(order) => {
                    let says = self.robots[number].says.clone();
                    let result = says.ok_or_else(|| String::from("there is no such program"));
                    self.later(number, SOON, Input::Told { question: order.question, result });
                }
                Effect::Answer { result, .. } => {
                    let answer = match result {
                        Ok(Accepted::System(answer)) => Ok(answer),
                        // of the role: no system is promised by it
                        Ok(Accepted::Role(_) | Accepted::Reset(_)) => continue,
                        Err(error) => Err(error),
                    };
                    if self.setup.keeps_events {
                        self.answers.push((number, answer.clone()));
                    }
                    self.sights.push(Sight::Answered { robot: number, answer });
                }
                Effect::Event(event) => {
                    self.trace.note(self.now, number, event.kind.as_bytes());
                    if self.setup.keeps_events {
                        self.told.push((self.now, number, event.clone()));
                    }
                    self.sights.push(Sight::Told { robot: number, event });
                }
            }
        }
        let robot = &mut self.robots[number];
        robot.effects_max = robot.effects_max.max(effects);
    }

    fn send(&mut self, from: usize, to: usize, bytes: Vec<u8>) {
        self.trace.note(self.now, from, &bytes);
        self.tally.sent(from, bytes.len() + FRAME_BYTES);
        let robot = &mut self.robots[from];
        robot.datagram_bytes_max = robot.datagram_bytes_max.max(bytes.len());
        if to >= self.robots.len() || !self.robots[to].is_on() {
            return;
        }
        let [first, again] = self.air.send(self.now, from, to);
        if let Some(at) = again {
            self.queue.push(at, Due::Datagram { to, from, bytes: bytes.clone() });
        }
        if let Some(at) = first {
            self.queue.push(at, Due::Datagram { to, from, bytes });
        }
    }

    fn store(&mut self, number: usize, order: Order) {
        self.trace.note(self.now, number, &[1]);
        let robot = &mut self.robots[number];
        let life = robot.life;
        if robot.disk.order(order) {
            let time = robot.disk.time;
            if let Some(down) = robot.crash_at_store.take() {
                let at = self.now + self.chance.time(Duration::ZERO, time + SOON);
                self.queue.push(at, Due::Crash { robot: number, life, down: Some(down) });
            }
            self.queue.push(self.now + time, Due::Stored { robot: number, life });
        }
    }

    pub(crate) fn stored(&mut self, number: usize) {
        let robot = &mut self.robots[number];
        let full = robot.disk.full;
        let (ticket, goes_on) = robot.disk.finish();
        if goes_on {
            let due = Due::Stored { robot: number, life: robot.life };
            self.queue.push(self.now + robot.disk.time, due);
        }
        let Some(ticket) = ticket else { return };
        let input = match full {
            true => Input::StoreFailed { ticket, reason: "no space left".into() },
            false => Input::Stored { ticket },
        };
        self.tell(number, input);
    }

    fn launch(&mut self, robot: usize, order: LaunchOrder) {
        let component = self.number(&order.component);
        let life = self.robots[robot].life;
        let instance = order.instance;
        self.trace.note(self.now, robot, &instance.to_le_bytes());
        self.robots[robot].launches += 1;
        self.sights.push(Sight::Launched { robot, component });
        let behaviour = self.behaviour(robot, order.component.name.as_str());
        if behaviour.unstartable {
            let news = InstanceNews::LaunchFailed { reason: "no such file".into() };
            return self.later(robot, SOON, Input::Instance { instance, news });
        }
        let mut inputs = Vec::new();
        for wiring in order.inputs {
            // a path is system/component/port
            let from = wiring.path.rsplit_once('/').map_or("", |(from, _)| from);
            let known = self.words.get(from).copied();
            let producer = known.or_else(|| self.number_of_word(from));
            inputs.extend(producer.map(|producer| (wiring, producer)));
        }
        for (_, producer) in &inputs {
            self.feeds[*producer].push((robot, instance));
        }
        let process = Process {
            component: order.component,
            number: component,
            spec: order.spec,
            hung: false,
            inputs,
            state: LifecycleState::Created,
            token: None,
            heard: std::collections::BTreeMap::new(),
            fenced: 0,
        };
        self.robots[robot].processes.insert(instance, process);
        let turn = |turn| Due::Turn { robot, life, instance, turn };
        self.queue.push(self.now + SOON, turn(Turn::Started));
        self.queue.push(self.now + behaviour.initialise.max(SOON), turn(Turn::Idle));
    }

    fn number_of_word(&mut self, word: &str) -> Option<usize> {
        let (system, word) = word.split_once('/')?;
        let name = |word| sdr_core::id::Name::new(word).ok();
        let key = sdr_core::id::ComponentKey::new(&name(system)?, &name(word)?);
        Some(self.number(&key))
    }

    fn behaviour(&self, robot: usize, word: &str) -> Behaviour {
        self.robots[robot].behaviours.get(word).cloned().unwrap_or_default()
    }

    fn command(&mut self, robot: usize, instance: InstanceId, command: Command) {
        let turn = match command {
            Command::Activate(token) => Turn::Active(token),
            // Processes here say themselves when they hang.
            Command::Patience(_) => return,
            Command::Deactivate | Command::Reset => Turn::Idle,
            Command::Finish => Turn::Exit("exit status 0"),
            Command::Kill => Turn::Exit("killed by signal 9"),
        };
        let life = self.robots[robot].life;
        self.queue.push(self.now + SOON, Due::Turn { robot, life, instance, turn });
    }

    /// A process does something by itself or as told, and its agent hears of it.
    pub(crate) fn turn(&mut self, robot: usize, instance: InstanceId, turn: Turn) {
        let Some(process) = self.robots[robot].processes.get_mut(&instance) else { return };
        let news = match turn {
            Turn::Started => {
                let pid = u32::try_from(instance).unwrap_or(u32::MAX);
                InstanceNews::Started { pid }
            }
            Turn::Idle if process.hung => return,
            Turn::Active(_) if process.hung => return,
            Turn::Idle => {
                self.set_state(robot, instance, LifecycleState::Inactive, None);
                state(LifecycleState::Inactive, None)
            }
            Turn::Active(token) => {
                self.set_state(robot, instance, LifecycleState::Active, Some(token.clone()));
                self.misbehave(robot, instance);
                state(LifecycleState::Active, Some(token))
            }
            Turn::Error(cause) => {
                let token = process.token.clone();
                self.set_state(robot, instance, LifecycleState::Error, None);
                let fault = Some((cause, String::from("the device is gone")));
                InstanceNews::State { state: LifecycleState::Error, token, fault }
            }
            Turn::Exit(reason) => {
                let process = self.robots[robot].processes.remove(&instance);
                if let Some(process) = process {
                    self.forget(robot, instance, &process);
                }
                InstanceNews::Exited { reason: reason.into() }
            }
            Turn::Hang => {
                process.hung = true;
                let life = self.robots[robot].life;
                let due = Due::Turn { robot, life, instance, turn: Turn::Seen };
                self.queue.push(self.now + HUNG_AFTER, due);
                return;
            }
            Turn::Seen => InstanceNews::Hung { reason: "no heartbeat for 1.0 s".into() },
        };
        self.tell(robot, Input::Instance { instance, news });
    }

    fn set_state(
        &mut self,
        robot: usize,
        instance: InstanceId,
        state: LifecycleState,
        token: Option<Token>,
    ) {
        let Some(process) = self.robots[robot].processes.get_mut(&instance) else { return };
        process.state = state;
        process.token.clone_from(&token);
        let component = process.number;
        let fed: Vec<usize> = process.inputs.iter().map(|(_, producer)| *producer).collect();
        let before = self.actives[component].len();
        self.actives[component].retain(|a| (a.robot, a.instance) != (robot, instance));
        let was_active = self.actives[component].len() < before;
        if let (LifecycleState::Active, Some(token)) = (state, token) {
            self.sights.push(Sight::Active { robot, instance, component, token: token.clone() });
            self.actives[component].push(ActiveProcess { robot, instance, token });
            self.flow_soon(component);
            fed.into_iter().for_each(|producer| self.flow_soon(producer));
        } else if was_active {
            self.sights.push(Sight::Inactive { robot, instance, component });
        }
    }

    /// What an active process does when it is not as it should be.
    fn misbehave(&mut self, robot: usize, instance: InstanceId) {
        let Some(process) = self.robots[robot].processes.get(&instance) else { return };
        let behaviour = self.behaviour(robot, process.component.name.as_str());
        let life = self.robots[robot].life;
        let turn = |turn| Due::Turn { robot, life, instance, turn };
        if let Some(after) = behaviour.crash_after {
            self.queue.push(self.now + after, turn(Turn::Exit("exit status 1")));
        }
        if let Some((after, cause)) = behaviour.fail_after {
            self.queue.push(self.now + after, turn(Turn::Error(cause)));
        }
    }

    fn route(&mut self, robot: usize, routes: &[Route]) {
        for route in routes {
            let matched = u16::try_from(route.peers.len()).unwrap_or(u16::MAX);
            self.later(robot, MATCHING, Input::Route { path: route.path.clone(), matched });
        }
        for path in self.robots[robot].take_routes(routes) {
            let from = path.rsplit_once('/').and_then(|(from, _)| self.words.get(from).copied());
            from.into_iter().for_each(|component| self.flow_soon(component));
        }
    }

    /// Host figures, and figures of all processes.
    pub(crate) fn sample(&mut self, number: usize) {
        let robot = &self.robots[number];
        let due = Due::Sample { robot: number, life: robot.life };
        self.queue.push(self.now + self.setup.host_period, due);
        let host = robot.measured();
        let figures: Vec<(InstanceId, Usage)> =
            robot.processes.iter().map(|(id, process)| (*id, robot.usage(process))).collect();
        if !figures.is_empty() {
            self.tell(number, Input::Usage(figures));
        }
        self.tell(number, Input::Host(host));
    }

    pub(crate) fn later(&mut self, robot: usize, after: Duration, input: Input) {
        let life = self.robots[robot].life;
        self.queue.push(self.now + after, Due::Input { robot, life, input });
    }
}

fn state(state: LifecycleState, token: Option<Token>) -> InstanceNews {
    InstanceNews::State { state, token, fault: None }
}
