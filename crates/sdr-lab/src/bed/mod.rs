//! The test bed: robots as namespaces of this machine, joined by a radio of ours.
//!
//! ```text
//!  robot-1: namespaces of network, mounts, processes      robot-2 ...
//!    agent, components ─ wlan0 (TAP) ───┐    ┌─── wlan0 ─ agent, components
//!                                       ▼    ▼
//!                 relay ── air: level, loss, bursts, delay, rate, cuts ◀── whoever plays
//!                 bodies ─▶ wireless, battery, position, meminfo, stat of each robot
//! ```
//!
//! Robots share no network and no shared memory; their sockets and files lie in one folder, so
//! that the one who plays can reach every agent. A robot that loses its power loses all its
//! processes and its shared memory, and keeps its disk. Everything goes when the [`Bed`] is dropped, and
//! also when its process is killed: see `hold`.

mod air;
mod body;
mod frame;
mod hold;
mod init;
mod link;
mod modulation;
mod orders;
mod relay;
mod robot;
mod slow;
mod sys;

use std::{io, net::Ipv4Addr, path::PathBuf, time::Duration};

use rustix::process::geteuid;
use thiserror::Error;

pub use air::{Air, Deaf, Traffic};
pub use body::{Bodies, Body, BodyPaths};
pub use hold::play;
pub use link::{Bursts, LinkChange, QUEUE_BYTES};
pub use orders::Whom;
pub use relay::SharedAir;
pub use robot::{Program, Robot};
pub use rustix::process::Signal;

/// The first argument of the program when it is started again inside a robot.
pub const ROLE: &str = "lab-role";
/// Most robots of one bed.
pub const ROBOTS_MAX: usize = 64;
/// Of all robots' addresses.
const MASK: Ipv4Addr = Ipv4Addr::new(255, 255, 0, 0);

/// The address of a robot's wlan0, by number from 0.
pub fn ip(number: u16) -> Ipv4Addr {
    let [high, low] = (number + 1).to_be_bytes();
    Ipv4Addr::new(10, 77, high, low)
}

/// A robot to make.
#[derive(Clone, Debug)]
pub struct RobotConfig {
    /// Its name.
    pub name: String,
    /// Its folder, which exists.
    pub folder: PathBuf,
    /// A small disk of its own: which folder, and how many bytes.
    pub disk: Option<(PathBuf, u64)>,
    /// Whether its disk can be slowed.
    pub slows: bool,
    /// Its body at the start.
    pub body: Body,
}

/// Why there is no bed. Nothing is left of what was begun.
#[derive(Debug, Error)]
#[non_exhaustive]
pub enum BedError {
    /// More robots than addresses and patience.
    #[error("{found} robots; allowed: 1 to {ROBOTS_MAX}")]
    Robots {
        /// How many.
        found: usize,
    },
    /// The program could not be started again.
    #[error("{robot}: cannot start its processes: {source}")]
    Start {
        /// Which robot.
        robot: String,
        /// What the system said.
        source: io::Error,
    },
    /// The system, or the robot's first process, refused.
    #[error("{robot}: {reason}")]
    Refused {
        /// Which robot.
        robot: String,
        /// What was tried, and the answer.
        reason: String,
    },
    /// It has no power.
    #[error("{robot} is switched off")]
    Off {
        /// Which robot.
        robot: String,
    },
    /// A thread of the bed.
    #[error("cannot start the radio: {0}")]
    Threads(io::Error),
}

impl BedError {
    /// Whether the machine lets nobody make robots like these, or not this user.
    pub fn is_refusal(&self) -> bool {
        matches!(self, Self::Refused { .. })
    }
}

/// The bed. Dropping it ends everything in it.
#[derive(Debug)]
pub struct Bed {
    /// In the order they were asked for.
    pub robots: Vec<Robot>,
    /// The radio.
    pub air: SharedAir,
    /// The robots' bodies.
    pub bodies: Bodies,
    since: Duration,
    // After the robots, so that they end first.
    _relay: relay::Relay,
    _writer: body::Writer,
}

impl Bed {
    /// Makes the robots, all switched off, and the radio between them.
    pub fn start(configs: Vec<RobotConfig>, seed: u64) -> Result<Self, BedError> {
        if configs.is_empty() || configs.len() > ROBOTS_MAX {
            return Err(BedError::Robots { found: configs.len() });
        }
        let user = !geteuid().is_root();
        let (mut robots, mut taps) = (Vec::new(), Vec::new());
        for (number, config) in (0..).zip(&configs) {
            let (robot, tap) = Robot::new(config, number, user)?;
            robots.push(robot);
            taps.push(tap);
        }
        let since = monotonic();
        let air = SharedAir::new(Air::new(robots.len(), seed));
        let bodies = Bodies::new(configs.iter().map(|config| config.body).collect());
        let paths = configs.iter().map(|config| BodyPaths::new(&config.folder)).collect();
        let writer = body::Writer::start(paths, bodies.clone(), air.clone(), since);
        let relay = relay::Relay::start(taps, air.clone(), since);
        Ok(Self {
            robots,
            air,
            bodies,
            since,
            _relay: relay.map_err(BedError::Threads)?,
            _writer: writer.map_err(BedError::Threads)?,
        })
    }

    /// The time of the radio and the bodies: since the bed was made.
    pub fn now(&self) -> Duration {
        monotonic().saturating_sub(self.since)
    }
}

/// CLOCK_MONOTONIC.
fn monotonic() -> Duration {
    Duration::from_nanos(crate::world::monotonic_ns())
}
