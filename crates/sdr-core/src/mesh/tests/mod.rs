//! The mesh of a few robots over a wire that loses, repeats and spoils.

mod life;
mod spreading;
mod wire;

use alloc::{
    collections::{BTreeMap, BTreeSet},
    format,
    vec::Vec,
};
use core::{net::SocketAddr, time::Duration};

use super::*;
use crate::{
    order::Version,
    record::{FleetValue, RecordKind, RoleRecord},
    report::HostReport,
    rng::Rng,
    units::Bytes,
};

const FLEET: u32 = 7;

fn robot(number: usize) -> RobotId {
    RobotId::new(&format!("robot-{number}")).unwrap()
}

fn address(number: usize) -> SocketAddr {
    SocketAddr::from(([127, 0, 0, 1], 7000 + u16::try_from(number).unwrap()))
}

fn mesh(number: usize, robots: usize, counter: u64) -> Mesh {
    let config = MeshConfig {
        robot: robot(number),
        fleet: FLEET,
        seeds: (0..robots).map(address).collect(),
        listen: Some(address(number)),
        period: Duration::from_millis(250),
        gone_after: Duration::from_secs(5),
    };
    let own = Incarnation { counter, nonce: u32::try_from(number).unwrap() };
    Mesh::new(config, own, FleetTable::default(), &[], Instant::ZERO)
}

fn role(holder: usize, term: u64) -> FleetRecord {
    let value = FleetValue::Role(RoleRecord {
        holder: robot(holder),
        term,
        fitness: 1,
        by_operator: false,
    });
    let version = Version { epoch: None, revision: 0, term, author: robot(holder) };
    FleetRecord::new(RecordKind::ROLE, "".into(), version, &value)
}

/// Robots in virtual time, joined by a wire that loses `loss` of 1000 datagrams.
struct Bench {
    meshes: Vec<Option<Mesh>>,
    now: Instant,
    rng: Rng,
    loss: usize,
    /// Nothing comes from the one to the other.
    cut: BTreeSet<(usize, usize)>,
    /// Where each robot listens: the number of an address.
    places: Vec<usize>,
    last: BTreeMap<usize, Vec<u8>>,
    news: Vec<(usize, MeshNews)>,
}

impl Bench {
    fn new(robots: usize, loss: usize) -> Self {
        let meshes = (0..robots).map(|number| Some(mesh(number, robots, 1))).collect();
        let rng = Rng::new(11);
        Self {
            meshes,
            now: Instant::ZERO,
            rng,
            loss,
            cut: BTreeSet::new(),
            places: (0..robots).collect(),
            last: BTreeMap::new(),
            news: Vec::new(),
        }
    }

    fn run(&mut self, time: Duration) {
        let end = self.now + time;
        while self.now < end {
            self.now = self.now + Duration::from_millis(10);
            for mesh in self.meshes.iter_mut().flatten() {
                mesh.handle_tick(self.now);
            }
            self.deliver();
        }
    }

    fn deliver(&mut self) {
        loop {
            let mut flying = Vec::new();
            for (number, mesh) in self.meshes.iter_mut().enumerate() {
                let Some(mesh) = mesh else { continue };
                while let Some((to, bytes)) = mesh.poll_send() {
                    assert!(bytes.len() <= DATAGRAM_BYTES_MAX);
                    self.last.insert(number, bytes.clone());
                    flying.push((number, to, bytes));
                }
                while let Some(news) = mesh.poll_news() {
                    self.news.push((number, news));
                }
            }
            if flying.is_empty() {
                return;
            }
            for (from, to, bytes) in flying {
                let place = usize::from(to.port() - 7000);
                let Some(number) = self.places.iter().position(|own| *own == place) else {
                    continue;
                };
                let lost = self.rng.below(1000) < self.loss || self.cut.contains(&(from, number));
                if let (Some(Some(mesh)), false) = (self.meshes.get_mut(number), lost) {
                    mesh.handle_datagram(self.now, address(self.places[from]), &bytes);
                }
            }
        }
    }

    /// Robot `number` neither hears nor is heard.
    fn silence(&mut self, number: usize) {
        let others = 0..self.meshes.len();
        self.cut.extend(others.flat_map(|other| [(number, other), (other, number)]));
    }

    fn said(&self, by: usize, news: &MeshNews) -> bool {
        self.news.contains(&(by, news.clone()))
    }

    fn mesh(&mut self, number: usize) -> &mut Mesh {
        self.meshes[number].as_mut().unwrap()
    }

    fn host_seen(&self, by: usize, of: usize) -> Option<HostReport> {
        let author = self.meshes[by].as_ref().unwrap().authors().author(&robot(of))?;
        author.reports().find_map(|report| match report {
            Report::Host(host) => Some(*host),
            Report::Facts(_)
            | Report::Link(..)
            | Report::Instance(_)
            | Report::Condition(_)
            | Report::Succession(_)
            | Report::Homeless(_)
            | Report::Stored(_) => None,
        })
    }
}

fn host(memory: u64) -> Report {
    Report::Host(HostReport { memory_used: Bytes(memory), ..HostReport::default() })
}
