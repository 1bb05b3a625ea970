//! The data plane between robots: this robot's bridge.
//!
//! ```text
//!  producer ─▶ shared memory ─▶ out_route: is it the active instance's? ─▶ transport (dds) ─┐
//!                    │                                                                      │
//!                    └▶ tap ─▶ recording, sensors                                           ▼
//!  consumer ◀─ shared memory ◀─ in_route: stamp what is put in ◀─ transport (dds) ◀──── network
//! ```
//!
//! One thread does it all and sleeps in one `poll`; the brain only says which routes there
//! should be. Bodies are CDR and never looked into; who made a sample travels beside it
//! ([`origin`]). Only samples that carry the token of the active instance leave the robot, and
//! what was put in here never leaves again, so nothing can go round in circles.

mod bell;
mod bridge;
mod complaint;
mod counters;
mod dds;
mod desk;
mod in_route;
mod origin;
mod out_route;
mod tap;
mod transport;

use std::{io, net::Ipv4Addr, sync::Arc, thread};

use sdr_component::{
    protocol::SharedMemory,
    shm::{Memory, ShmError},
};
use sdr_core::{effect::Route, id::RobotId, input::Input};
use tokio::sync::mpsc::Sender;

use bell::Bell;
use bridge::{Bridge, Setting};
use dds::Dds;
use desk::Desk;

pub(crate) use counters::{Ledger, RouteCounters};
pub(crate) use tap::{TapSample, TapSink};
pub(crate) use transport::Way;

/// What makes one robot's data plane its own.
#[derive(Clone, Debug)]
pub(crate) struct DataConfig {
    /// This robot.
    pub(crate) robot: RobotId,
    /// DDS domain of the fleet, 0 to 232.
    pub(crate) domain_id: u16,
    /// The addresses of this robot that DDS uses; empty: all.
    pub(crate) addresses: Vec<Ipv4Addr>,
    /// Where this robot's shared memory is.
    pub(crate) memory: SharedMemory,
}

/// Why the data plane did not start; nothing was left behind.
#[derive(Debug, thiserror::Error)]
pub(crate) enum DataError {
    /// The operator can mend it.
    #[error("data plane: {0}")]
    Memory(#[from] ShmError),
    /// No descriptor or no thread left.
    #[error("data plane: {0}")]
    System(#[from] io::Error),
}

/// A handle to the bridge. Calls leave an order and return at once.
#[derive(Debug)]
pub(crate) struct Data {
    bell: Arc<Bell>,
    desk: Arc<Desk>,
    ledger: Arc<Ledger>,
    thread: Option<thread::JoinHandle<()>>,
}

impl Data {
    /// Starts the bridge without routes; news of routes goes to `inputs`, samples of tapped
    /// ports to `record`.
    pub(crate) fn start(
        config: DataConfig,
        inputs: Sender<Input>,
        record: TapSink,
    ) -> Result<Self, DataError> {
        let bell = Arc::new(Bell::new()?);
        let (desk, ledger) = (Arc::new(Desk::default()), Arc::new(Ledger::default()));
        let (domain_id, addresses) = (config.domain_id, config.addresses);
        let setting = Setting {
            memory: Memory::open(&config.memory, "sdr-agent-data")?,
            robot: config.robot,
            join: Box::new(move |bell| Ok(Box::new(Dds::join(domain_id, &addresses, bell)?))),
            bell: Arc::clone(&bell),
            desk: Arc::clone(&desk),
            ledger: Arc::clone(&ledger),
            inputs,
            record,
        };
        let thread = thread::Builder::new()
            .name("sdr-data".into())
            .spawn(move || Bridge::new(setting).run())?;
        Ok(Self { bell, desk, ledger, thread: Some(thread) })
    }

    /// These routes, and no others, from now on.
    pub(crate) fn set_routes(&self, routes: Vec<Route>) {
        self.desk.put(|wanted| wanted.routes = Some(routes));
        self.bell.ring();
    }

    /// The robots known to this one: only their epochs can be told from their samples.
    pub(crate) fn set_robots(&self, robots: Vec<RobotId>) {
        self.desk.put(|wanted| wanted.robots = Some(robots));
        self.bell.ring();
    }

    /// These local ports (`system.component.port`), and no others, go to the sink.
    pub(crate) fn tap(&self, ports: Vec<String>) {
        self.desk.put(|wanted| wanted.taps = Some(ports));
        self.bell.ring();
    }

    /// The book of what each route does, for those who ask later.
    pub(crate) fn ledger(&self) -> Arc<Ledger> {
        Arc::clone(&self.ledger)
    }

    /// What each route did so far.
    pub(crate) fn counters(&self) -> Vec<(String, Way, RouteCounters)> {
        self.ledger.read()
    }

    /// Ends the bridge and leaves the network; waits for it, some tens of milliseconds.
    pub(crate) fn stop(self) {
        drop(self);
    }
}

impl Drop for Data {
    fn drop(&mut self) {
        for (path, way, counters) in self.counters() {
            let counts: Vec<_> = counters.named().filter(|(_, count)| *count > 0).collect();
            tracing::debug!(event = "route-ended", path, ?way, ?counts);
        }
        self.desk.put(|wanted| wanted.stop = true);
        self.bell.ring();
        if let Some(thread) = self.thread.take()
            && thread.join().is_err()
        {
            tracing::error!(event = "data-plane-died", "the bridge's thread had panicked");
        }
    }
}

#[cfg(test)]
mod tests;
