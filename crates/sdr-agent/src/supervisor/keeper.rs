//! One task a process: from its start to its end, which is told exactly once.

mod bury;

use std::collections::BTreeMap;
use std::io;
use std::rc::Rc;

use rustix::process::Signal;
use sdr_component::protocol::{
    Configure, ErrorReport, FromComponent, Hello, InputCounters, LineBuffer, Order,
    PROTOCOL_VERSION, StateReport, ToComponent,
};
use sdr_core::{
    effect::{Command, LaunchOrder},
    input::InstanceNews,
    lifecycle::LifecycleState,
    time::Instant,
};
use tokio::net::UnixStream;
use tokio::sync::mpsc;

use super::instance::{Life, Overdue};
use super::process::Process;
use super::{Shared, samples, socket};
use crate::clock;
use crate::trouble::Kind;

/// Orders kept for a component that has not greeted yet.
const PENDING_MAX: usize = 16;

/// What reaches a keeper.
#[derive(Debug)]
pub(super) enum Message {
    /// An order of the brain.
    Command(Command),
    /// Its process greeted; who it is was checked.
    Greeted(Box<Greeting>),
}

/// A checked connection.
#[derive(Debug)]
pub(super) struct Greeting {
    pub(super) stream: UnixStream,
    pub(super) buffer: LineBuffer,
    pub(super) hello: Hello,
}

/// Watches one process.
pub(super) struct Keeper {
    shared: Rc<Shared>,
    order: LaunchOrder,
    process: Process,
    link: Option<Link>,
    life: Life,
    configured: bool,
    pending: Vec<Order>,
    /// Missed deadlines by connection, as they were told last.
    late: BTreeMap<u16, u64>,
    /// When this task last ran, to know a stall of the agent from one of the component.
    turned_at: Instant,
}

struct Link {
    stream: UnixStream,
    buffer: LineBuffer,
}

/// Why a keeper's turn came.
enum Turn {
    Told(Message),
    Received(io::Result<usize>),
    Exited,
    TimePassed,
}

impl Keeper {
    /// Starts the process and stays until it is gone.
    pub(super) async fn keep(
        shared: Rc<Shared>,
        order: LaunchOrder,
        mut messages: mpsc::Receiver<Message>,
    ) {
        let instance = order.instance;
        let started = Process::start((&shared.config, &shared.limiter), &order);
        match started {
            Ok(process) => {
                let mut keeper = Self::new(Rc::clone(&shared), order, process);
                let pid = keeper.announce();
                shared.tell(instance, InstanceNews::Started { pid }).await;
                keeper.watch(&mut messages).await;
                keeper.bury().await;
            }
            Err(error) => {
                let reason = error.to_string();
                shared.kept.borrow_mut().remove(&instance);
                shared.tell(instance, InstanceNews::LaunchFailed { reason }).await;
            }
        }
    }

    /// Goes on with a process that an agent before this one started.
    pub(super) fn adopt(shared: Rc<Shared>, order: LaunchOrder, process: Process) -> Self {
        let mut keeper = Self::new(shared, order, process);
        keeper.life.adopted();
        keeper.announce();
        keeper
    }

    /// Stays with what was adopted until it is gone.
    pub(super) async fn stay(mut self, mut messages: mpsc::Receiver<Message>) {
        self.watch(&mut messages).await;
        self.bury().await;
    }

    fn new(shared: Rc<Shared>, order: LaunchOrder, process: Process) -> Self {
        let now = clock::now();
        let life = Life::new(shared.config.patience, order.spec.execution, now);
        Self {
            shared,
            order,
            process,
            link: None,
            life,
            configured: false,
            pending: Vec::new(),
            late: BTreeMap::new(),
            turned_at: now,
        }
    }

    /// The process runs: everybody who watches processes gets to know it.
    fn announce(&self) -> u32 {
        let (instance, component) = (self.order.instance, &self.order.component);
        let pid = self.process.id();
        if let Some(kept) = self.shared.kept.borrow_mut().get_mut(&instance) {
            kept.pid = pid;
            kept.badge.clone_from(&self.process.keepsake.badge);
        }
        let Process { executable, keepsake, .. } = &self.process;
        self.shared.journal.add(instance, pid, executable, keepsake);
        self.shared.outlets.watch.add(instance, pid, component);
        tracing::debug!(event = "started", %component, instance, pid);
        pid
    }

    /// Until the process ends.
    async fn watch(&mut self, messages: &mut mpsc::Receiver<Message>) {
        loop {
            match self.turn(messages).await {
                Turn::Told(Message::Command(command)) => self.command(command).await,
                Turn::Told(Message::Greeted(greeting)) => self.greeted(*greeting).await,
                Turn::Received(received) => self.received(received).await,
                Turn::Exited => return,
                Turn::TimePassed => {}
            }
            self.look_at_the_clock().await;
        }
    }

    /// Waits for the next thing to do. Lines come before the exit, so that a component's last
    /// words are heard before its end.
    async fn turn(&mut self, messages: &mut mpsc::Receiver<Message>) -> Turn {
        let deadline = self.life.deadline();
        let Self { link, process, .. } = self;
        let line = async {
            match link {
                Some(link) => socket::receive(&link.stream, &mut link.buffer).await,
                None => std::future::pending().await,
            }
        };
        tokio::select! {
            biased;
            Some(message) = messages.recv() => Turn::Told(message),
            received = line => Turn::Received(received),
            () = process.ended() => Turn::Exited,
            () = clock::sleep_until(deadline) => Turn::TimePassed,
        }
    }

    async fn command(&mut self, command: Command) {
        let now = clock::now();
        match command {
            Command::Activate(token) => self.tell(Order::Activate { token }).await,
            Command::Deactivate => self.tell(Order::Deactivate).await,
            Command::Reset => self.tell(Order::Reset).await,
            Command::Patience(limit) => self.life.be_patient(limit),
            Command::Finish => {
                self.life.finish(now);
                match self.link {
                    Some(_) => self.tell(Order::Finish).await,
                    // It will greet in a moment, and be told then.
                    None if self.life.is_returning() => {}
                    // Nobody is there to be asked.
                    None => self.terminate(now),
                }
            }
            Command::Kill => self.kill(now),
        }
    }

    /// Sends an order, now or as soon as the component has greeted and was configured.
    async fn tell(&mut self, order: Order) {
        if self.link.is_some() && self.configured {
            let what = word(&order);
            self.send(ToComponent::Command(order)).await;
            if let Some(what) = what.filter(|_| self.link.is_some()) {
                self.life.ordered(what, clock::now());
            }
            return;
        }
        if self.pending.len() == PENDING_MAX {
            self.pending.remove(0);
        }
        self.pending.push(order);
    }

    async fn send(&mut self, message: ToComponent) {
        let Some(link) = &mut self.link else { return };
        if let Err(error) = socket::say(&mut link.stream, &message).await {
            let component = &self.order.component;
            tracing::warn!(event = "component-deaf", %component, %error, next = "await its greeting");
            self.unlink();
        }
    }

    /// The component is there: tell it what it must know, and what was waiting for it.
    async fn greeted(&mut self, greeting: Greeting) {
        let Greeting { stream, buffer, hello } = greeting;
        self.link = Some(Link { stream, buffer });
        self.life.linked(clock::now());
        self.shared.outlets.types.learn(&self.order, &hello.profile);
        if hello.now.state == LifecycleState::Created {
            if !self.configured {
                self.configured = true;
                self.life.configured(clock::now());
                self.send(ToComponent::Configure(Box::new(self.configure()))).await;
            }
        } else {
            self.configured = true;
            self.state(hello.now).await;
        }
        for order in std::mem::take(&mut self.pending) {
            self.tell(order).await;
        }
        if self.life.is_ending() {
            self.send(ToComponent::Command(Order::Finish)).await;
        }
        // Lines may have come with the greeting.
        self.read_lines().await;
    }

    fn unlink(&mut self) {
        self.link = None;
        self.life.unlinked(clock::now());
    }

    fn configure(&self) -> Configure {
        let spec = &self.order.spec;
        let config = &self.shared.config;
        let wanted = |name: &String| spec.devices.iter().any(|device| device.as_str() == name);
        let devices = config.devices.iter().filter(|(name, _)| wanted(name));
        Configure {
            v: PROTOCOL_VERSION,
            component: self.order.component.clone(),
            parameters: spec.parameters.iter().cloned().collect(),
            devices: devices.map(|(name, path)| (name.clone(), path.clone())).collect(),
            inputs: self.order.inputs.clone(),
            output_depth: self.order.output_depth,
            memory: config.memory.clone(),
            execution: spec.execution.into(),
        }
    }

    async fn received(&mut self, received: io::Result<usize>) {
        match received {
            Ok(0) => self.unlink(),
            Ok(_) => self.read_lines().await,
            Err(error) => {
                let component = &self.order.component;
                tracing::debug!(event = "link-broken", %component, %error);
                self.unlink();
            }
        }
    }

    async fn read_lines(&mut self) {
        while let Some(link) = &mut self.link {
            match link.buffer.next_message::<FromComponent>() {
                Ok(Some(message)) => self.line(message).await,
                Ok(None) => return,
                Err(error) => {
                    let message = format!("{}: {error}", self.order.component);
                    self.shared.outlets.trouble.count(Kind::ComponentLine, &message);
                    self.send(ToComponent::Error(ErrorReport { message })).await;
                    self.unlink();
                }
            }
        }
    }

    async fn line(&mut self, message: FromComponent) {
        let instance = self.order.instance;
        match message {
            FromComponent::Hello(hello) => self.state(hello.now).await,
            FromComponent::State(report) => self.state(report).await,
            FromComponent::Heard(heard) => {
                let news = InstanceNews::Heard { connection: heard.connection, token: heard.token };
                self.shared.tell(instance, news).await;
            }
            FromComponent::Beat(_) => self.life.beat(clock::now()),
            FromComponent::Counters(counters) => {
                samples::record(&counters, &self.order, &self.shared.outlets.record);
                self.late(&counters.inputs).await;
            }
            FromComponent::Error(report) => {
                let component = &self.order.component;
                tracing::warn!(event = "component-says", %component, "{}", report.message);
                self.life.answered(clock::now());
            }
        }
    }

    /// Tells the brain of deadlines that were missed since it was told last.
    async fn late(&mut self, inputs: &[InputCounters]) {
        let wired = |connection| self.order.inputs.iter().any(|one| one.connection == connection);
        for input in inputs.iter().filter(|input| wired(input.connection)) {
            let (connection, count) = (input.connection, input.late);
            let told = self.late.insert(connection, count).unwrap_or(0);
            if count != told {
                let news = InstanceNews::Late { connection, count };
                self.shared.tell(self.order.instance, news).await;
            }
        }
    }

    async fn state(&mut self, report: StateReport) {
        let StateReport { state, token, fault } = report;
        self.life.state(state, clock::now());
        let outlets = &self.shared.outlets;
        outlets.watch.state(self.order.instance, state, token.as_ref(), &outlets.record);
        let fault = fault.map(|fault| (fault.cause, fault.reason));
        self.shared.tell(self.order.instance, InstanceNews::State { state, token, fault }).await;
    }

    async fn look_at_the_clock(&mut self) {
        let now = clock::now();
        if now.since(self.turned_at) > self.shared.config.patience.beat / 2
            && self.life.deadline().is_some_and(|due| now.since(due) > self.stall())
        {
            self.life.forgive(now);
        }
        self.turned_at = now;
        match self.life.overdue(now) {
            Some(Overdue::Hung(reason)) => {
                self.shared.tell(self.order.instance, InstanceNews::Hung { reason }).await;
            }
            Some(Overdue::Terminate) => self.terminate(now),
            Some(Overdue::Kill) => self.kill(now),
            None => {}
        }
    }

    /// A timer of ours that is later than this says more about us than about the component.
    fn stall(&self) -> std::time::Duration {
        self.shared.config.patience.beat / 4
    }

    fn terminate(&mut self, now: Instant) {
        self.life.terminated(now);
        self.process.signal(Signal::TERM);
    }

    fn kill(&mut self, now: Instant) {
        self.life.killed(now);
        self.process.signal(Signal::KILL);
    }
}

/// The order's name when a state must answer it; the end has limits of its own.
fn word(order: &Order) -> Option<&'static str> {
    match order {
        Order::Activate { .. } => Some("activate"),
        Order::Deactivate => Some("deactivate"),
        Order::Reset => Some("reset"),
        Order::Finish => None,
    }
}
