//! The bridge of one robot: its own thread, all routes and taps, one wait.

use std::{
    collections::{BTreeMap, BTreeSet},
    sync::Arc,
    time::{Duration, Instant},
};

use rustix::{
    event::{PollFd, PollFlags, Timespec, poll},
    io::Errno,
};
use sdr_component::shm::Memory;
use sdr_core::{
    effect::{Direction, Route},
    id::RobotId,
    input::Input,
};
use tokio::sync::mpsc::{Sender, error::TrySendError};

use super::{
    bell::Bell,
    counters::Ledger,
    desk::{Desk, Wanted},
    in_route::{InRoute, Names},
    out_route::{Left, OutRoute},
    tap::{Tap, TapSink},
    transport::{Matched, Topic, Transport, TransportError, Way},
};

/// A look at everything, against wake-ups that never came.
const SWEEP_PERIOD: Duration = Duration::from_secs(1);
/// Pause before news is offered again to a brain whose queue was full.
const NEWS_AGAIN_AFTER: Duration = Duration::from_millis(20);

/// Joins the network between robots; called at the first route, and again after failures.
pub(super) type Join =
    Box<dyn FnMut(&Arc<Bell>) -> Result<Box<dyn Transport>, TransportError> + Send>;

/// What the bridge's thread needs from its maker.
pub(super) struct Setting {
    pub(super) robot: RobotId,
    pub(super) memory: Memory,
    pub(super) join: Join,
    pub(super) bell: Arc<Bell>,
    pub(super) desk: Arc<Desk>,
    pub(super) ledger: Arc<Ledger>,
    pub(super) inputs: Sender<Input>,
    pub(super) record: TapSink,
}

/// Everything that crosses this robot's border.
pub(super) struct Bridge {
    setting: Setting,
    transport: Option<Box<dyn Transport>>,
    outs: BTreeMap<String, OutRoute>,
    ins: BTreeMap<String, InRoute>,
    taps: BTreeMap<String, Tap>,
    robots: Vec<RobotId>,
    peers: BTreeSet<RobotId>,
    names: Names,
    matched: BTreeMap<(String, Way), u16>,
    /// Paths whose count the brain does not know yet.
    news: BTreeSet<String>,
    swept_at: Instant,
    buffer: Vec<u8>,
}

/// What one wait found.
struct Ready {
    rung: bool,
    outs: Vec<String>,
    taps: Vec<String>,
}

impl Bridge {
    pub(super) fn new(setting: Setting) -> Self {
        let names = Names::of(std::iter::once(&setting.robot));
        Self {
            setting,
            transport: None,
            outs: BTreeMap::new(),
            ins: BTreeMap::new(),
            taps: BTreeMap::new(),
            robots: Vec::new(),
            peers: BTreeSet::new(),
            names,
            matched: BTreeMap::new(),
            news: BTreeSet::new(),
            swept_at: Instant::now(),
            buffer: Vec::new(),
        }
    }

    /// Works until told to stop.
    pub(super) fn run(mut self) {
        loop {
            let ready = self.wait();
            if ready.rung {
                self.setting.bell.hush();
                let wanted = self.setting.desk.take();
                if wanted.stop {
                    return;
                }
                self.apply(wanted);
                self.receive();
                self.carry_all();
            }
            self.carry(&ready);
            self.release();
            if self.swept_at.elapsed() >= SWEEP_PERIOD {
                self.sweep();
            }
            self.tell();
        }
    }

    fn apply(&mut self, wanted: Wanted) {
        if let Some(robots) = wanted.robots {
            self.robots = robots;
        }
        if let Some(routes) = wanted.routes {
            self.set_routes(routes);
        }
        if let Some(ports) = wanted.taps {
            self.taps.retain(|port, _| ports.contains(port));
            for port in ports {
                self.taps.entry(port).or_insert_with_key(|port| Tap::new(port));
            }
        }
        let known = self.robots.iter().chain(&self.peers);
        self.names = Names::of(known.chain(std::iter::once(&self.setting.robot)));
        self.open();
    }

    /// The difference between the routes that are and those that should be.
    fn set_routes(&mut self, routes: Vec<Route>) {
        let mut wanted = BTreeMap::new();
        self.peers.clear();
        for Route { path, message_type, qos, direction, peers } in routes {
            self.peers.extend(peers);
            let topic = Topic { path: path.clone(), message_type, qos };
            let (way, active) = match direction {
                Direction::Out { active } => (Way::Out, active),
                Direction::In => (Way::In, None),
            };
            wanted.insert((path, way), (topic, active));
        }
        self.close_unless(|path, way, topic| {
            wanted.get(&(path.to_owned(), way)).is_some_and(|(wanted, _)| wanted == topic)
        });
        let ledger = &self.setting.ledger;
        for ((path, way), (topic, active)) in wanted {
            match way {
                Way::Out => self
                    .outs
                    .entry(path)
                    .or_insert_with_key(|path| OutRoute::new(topic, ledger.open(path, way)))
                    .set_active(active.as_ref()),
                Way::In => {
                    self.ins
                        .entry(path)
                        .or_insert_with_key(|path| InRoute::new(topic, ledger.open(path, way)));
                }
            }
        }
    }

    fn close_unless(&mut self, stays: impl Fn(&str, Way, &Topic) -> bool) {
        let mut gone = Vec::new();
        for (path, route) in &mut self.outs {
            if !stays(path, Way::Out, &route.topic) {
                route.close(self.transport.as_deref_mut());
                gone.push((path.clone(), Way::Out));
            }
        }
        for (path, route) in &mut self.ins {
            if !stays(path, Way::In, &route.topic) {
                route.close(self.transport.as_deref_mut());
                gone.push((path.clone(), Way::In));
            }
        }
        for (path, way) in gone {
            match way {
                Way::Out => drop(self.outs.remove(&path)),
                Way::In => drop(self.ins.remove(&path)),
            }
            self.setting.ledger.close(&path, way);
            if self.matched.remove(&(path.clone(), way)).is_some() {
                self.news.insert(path);
            }
        }
    }

    /// Opens what is wanted and not open; the network is joined at the first route.
    fn open(&mut self) {
        self.open_ports();
        let wanted = !(self.outs.is_empty() && self.ins.is_empty());
        if wanted && self.transport.is_none() {
            match (self.setting.join)(&self.setting.bell) {
                Ok(transport) => {
                    self.transport = Some(transport);
                    self.open_ports();
                }
                Err(error) => {
                    tracing::warn!(event = "network-unjoined", %error, "again in a second");
                }
            }
        }
    }

    fn open_ports(&mut self) {
        let memory = &self.setting.memory;
        for route in self.outs.values_mut() {
            route.open(memory, self.transport.as_deref_mut());
        }
        for route in self.ins.values_mut() {
            route.open(memory, self.transport.as_deref_mut());
        }
        for tap in self.taps.values_mut() {
            tap.open(memory);
        }
    }

    /// Sleeps until something may be waiting.
    fn wait(&self) -> Ready {
        // Without a network nothing can be carried, and what waits would wake us for ever.
        let outs = self.outs.iter().filter(|_| self.transport.is_some());
        let outs = outs.filter_map(|(path, route)| Some((path, route.wake_fd()?)));
        let outs: Vec<_> = outs.collect();
        let taps = self.taps.iter().filter_map(|(port, tap)| Some((port, tap.wake_fd()?)));
        let taps: Vec<_> = taps.collect();
        let mut fds = vec![PollFd::new(&*self.setting.bell, PollFlags::IN)];
        fds.extend(outs.iter().chain(&taps).map(|(_, fd)| PollFd::new(fd, PollFlags::IN)));
        let limit = Timespec::try_from(self.wait_max()).expect("at most a second");
        match poll(&mut fds, Some(&limit)) {
            // A signal is no reason to do anything.
            Ok(_) | Err(Errno::INTR) => {}
            Err(errno) => panic!("poll over our own descriptors: {errno}"),
        }
        let mut woken = fds.iter().map(|fd| !fd.revents().is_empty());
        let rung = woken.next().unwrap_or_default();
        let mut names = |ports: &[(&String, _)]| -> Vec<String> {
            let woken = ports.iter().zip(woken.by_ref()).filter(|(_, woken)| *woken);
            woken.map(|((name, _), _)| (*name).clone()).collect()
        };
        Ready { rung, outs: names(&outs), taps: names(&taps) }
    }

    fn wait_max(&self) -> Duration {
        let now = Instant::now();
        let held = self.ins.values().filter_map(InRoute::next_deadline);
        let again = (!self.news.is_empty()).then(|| now + NEWS_AGAIN_AFTER);
        let next = held.chain(again).chain(std::iter::once(self.swept_at + SWEEP_PERIOD)).min();
        next.map_or(SWEEP_PERIOD, |next| next.saturating_duration_since(now))
    }

    fn receive(&mut self) {
        let Some(transport) = &mut self.transport else { return };
        while let Some(Matched { endpoint, count }) = transport.poll_matched() {
            let out = self.outs.iter().find(|(_, route)| route.is_endpoint(endpoint));
            let found = match out {
                Some((path, route)) => Some((path, Way::Out, route.counts())),
                None => self
                    .ins
                    .iter()
                    .find(|(_, route)| route.is_endpoint(endpoint))
                    .map(|(path, route)| (path, Way::In, route.counts())),
            };
            if let Some((path, way, counts)) = found {
                counts.matched.set(u64::from(count));
                self.matched.insert((path.clone(), way), count);
                self.news.insert(path.clone());
            }
        }
        for route in self.ins.values_mut() {
            if route.receive(&mut **transport, &self.names, &mut self.buffer) == Left::Samples {
                self.setting.bell.ring();
            }
        }
    }

    fn carry(&mut self, ready: &Ready) {
        for path in &ready.outs {
            if let (Some(route), Some(transport)) = (self.outs.get_mut(path), &mut self.transport)
                && route.carry(&mut **transport) == Left::Samples
            {
                self.setting.bell.ring();
            }
        }
        for port in &ready.taps {
            if let Some(tap) = self.taps.get_mut(port) {
                tap.carry(&mut self.setting.record);
            }
        }
    }

    fn carry_all(&mut self) {
        let Some(transport) = &mut self.transport else { return };
        for route in self.outs.values_mut() {
            if route.carry(&mut **transport) == Left::Samples {
                self.setting.bell.ring();
            }
        }
    }

    fn release(&mut self) {
        let now = Instant::now();
        for route in self.ins.values_mut() {
            route.release(&self.names, now);
        }
    }

    fn sweep(&mut self) {
        self.swept_at = Instant::now();
        self.open();
        if let Some(transport) = &mut self.transport {
            transport.sweep();
        }
        self.receive();
        self.carry_all();
        for tap in self.taps.values_mut() {
            tap.carry(&mut self.setting.record);
        }
    }

    /// Tells the brain how many peers its routes have. Where a path has both ways, the readers
    /// of what leaves here count: what arrives shows by itself.
    fn tell(&mut self) {
        while let Some(path) = self.news.pop_first() {
            let out = self.matched.get(&(path.clone(), Way::Out));
            let into = self.matched.get(&(path.clone(), Way::In));
            let matched = out.or(into).copied().unwrap_or(0);
            let routed = self.outs.contains_key(&path) || self.ins.contains_key(&path);
            if !routed {
                continue;
            }
            let news = Input::Route { path: path.clone(), matched };
            match self.setting.inputs.try_send(news) {
                // Without a brain nobody wants to know.
                Ok(()) | Err(TrySendError::Closed(_)) => {}
                Err(TrySendError::Full(_)) => {
                    self.news.insert(path);
                    return;
                }
            }
        }
    }
}
