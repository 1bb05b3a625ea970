//! Fleets that start converged: what a cold start brings together is there at the first moment.
//!
//! ```text
//! all deaf: the first robot is told of all others, deploys, and places ─▶ its table
//! all deaf: everybody starts anew from a disk with that table, and runs what is its own
//! everybody is told what the others say of themselves; the radio goes on
//! ```
//!
//! Only disks and datagrams are used, as agents have them; no brain is touched inside.

use std::time::Duration;

use sdr_core::{
    brain::Brain,
    effect::StoredState,
    input::Input,
    mesh::{Fact, FleetRecord, Mesh, Section},
    order::Version,
    record::{FleetValue, RecordKind, RoleRecord},
    spec::SystemSpec,
    time::Instant,
};

use super::{Fleet, Tally, air::address, check::convergence};

/// The robot that plans and holds the role.
const PLANNER: usize = 0;
/// The planner hears of the others so often.
const RELAY_EVERY: Duration = Duration::from_secs(1);
/// Placing everything takes less.
const PLANNED_MAX: Duration = Duration::from_secs(600);
/// Everything runs within this time after the second start.
const RUNNING_MAX: Duration = Duration::from_secs(30);
/// The radio is on for so long for each robot before the fleet is said to have started: each
/// tells of all that it met, up to so many, and of what they said.
const SETTLED_EACH: Duration = Duration::from_millis(300);
const TOLD_MAX: u32 = 256;
/// What is still under way then comes within this time.
const AGREED_MAX: Duration = Duration::from_secs(60);

impl Fleet {
    /// Starts all robots, all of them off before, as if they had been together for long, with
    /// `systems` running; what is lacking in the end, in words.
    pub(crate) fn start_converged(&mut self, systems: &[SystemSpec]) -> Result<(), String> {
        let keeps: Vec<bool> = self.robots.iter().map(|robot| robot.disk.is_read).collect();
        self.keep_disk(PLANNER, true);
        let all = 0..self.robots.len();
        all.clone()
            .for_each(|robot| self.air.deafen(robot, self.now, Instant::from_nanos(u64::MAX)));
        let mut first = StoredState { incarnation: 1, ..StoredState::default() };
        Fact::read(self.first_role()).and_then(|role| first.fleet.put(role));
        self.start_from(&first);
        self.plan_alone(systems)?;
        let planned = self.robots[PLANNER].disk.held().cloned();
        let planned = planned.ok_or("the planner stored nothing")?;
        all.clone().for_each(|robot| self.switch_off(robot));
        self.start_from(&planned);
        for (robot, keep) in keeps.into_iter().enumerate() {
            self.keep_disk(robot, keep);
            if !keep {
                self.robots[robot].disk.hold(None);
            }
        }
        let everybody: Vec<usize> = all.clone().collect();
        self.run_until(RUNNING_MAX, |fleet| convergence::each_once(fleet, &everybody))?;
        self.introduce_all();
        all.for_each(|robot| self.air.hear(robot, self.now));
        let told = u32::try_from(self.robots.len()).unwrap_or(TOLD_MAX).clamp(20, TOLD_MAX);
        self.run(SETTLED_EACH * told);
        self.run_until(AGREED_MAX, convergence::lacking)?;
        self.take_sights();
        self.tally = Tally::new(self.robots.len());
        Ok(())
    }

    /// The role in the hands of the planner.
    fn first_role(&self) -> FleetRecord {
        let holder = self.robots[PLANNER].id.clone();
        let version = Version { epoch: None, revision: 0, term: 1, author: holder.clone() };
        let role = RoleRecord { holder, term: 1, fitness: 1000, by_operator: false };
        FleetRecord::new(RecordKind::ROLE, String::new(), version, &FleetValue::Role(role))
    }

    /// Everybody starts from this state; only the planner reserved what is in it.
    fn start_from(&mut self, state: &StoredState) {
        for robot in 0..self.robots.len() {
            let mut own = state.clone();
            if robot != PLANNER {
                own.runs.clear();
                own.epochs.clear();
                own.peers.clear();
            }
            self.robots[robot].disk.hold(Some(own));
            self.switch_on(robot);
        }
    }

    /// The planner learns of all others, takes the systems, and finds a home for everything.
    fn plan_alone(&mut self, systems: &[SystemSpec]) -> Result<(), String> {
        self.run(self.setup.host_period * 3 / 2);
        self.introduce_to(PLANNER);
        systems.iter().for_each(|system| self.deploy(PLANNER, system));
        let wanted: usize = systems.iter().map(|system| system.components.len()).sum();
        let end = self.now + PLANNED_MAX;
        loop {
            self.run(RELAY_EVERY);
            let table = self.table(PLANNER).ok_or("the planner is off")?;
            let placed = table.of_kind(RecordKind::ASSIGNMENT).count();
            if placed >= wanted {
                // until the last choice is on disk
                self.run(RELAY_EVERY);
                return Ok(());
            }
            if self.now >= end {
                return Err(format!("{placed} of {wanted} components were placed"));
            }
            self.introduce_to(PLANNER);
        }
    }

    /// Lets time pass until nothing is lacking.
    fn run_until(
        &mut self,
        limit: Duration,
        lacking: impl Fn(&Self) -> Option<String>,
    ) -> Result<(), String> {
        let end = self.now + limit;
        while let Some(what) = lacking(self) {
            if self.now >= end {
                return Err(what);
            }
            self.run(Duration::from_millis(200));
        }
        Ok(())
    }

    fn introduce_all(&mut self) {
        let sections = self.introductions();
        // nobody can be told by itself: the first one hears of all from the second one
        let told = self.told_by(PLANNER, &sections);
        for robot in (0..self.robots.len()).filter(|robot| *robot != PLANNER) {
            self.hand_over(robot, PLANNER, &told);
        }
        self.introduce_to(PLANNER);
    }

    fn introduce_to(&mut self, robot: usize) {
        let teller = (robot + 1) % self.robots.len();
        let sections = self.introductions();
        let datagrams = self.told_by(teller, &sections);
        if teller != robot {
            self.hand_over(robot, teller, &datagrams);
        }
    }

    /// What all robots say of themselves now.
    fn introductions(&mut self) -> Vec<Section> {
        let all = 0..self.robots.len();
        all.clone().for_each(|robot| self.tell(robot, Input::Tick));
        all.filter_map(|robot| self.mesh(robot)).flat_map(Mesh::introduction).collect()
    }

    fn told_by(&self, teller: usize, sections: &[Section]) -> Vec<Vec<u8>> {
        self.mesh(teller).map(|mesh| mesh.datagrams(sections)).unwrap_or_default()
    }

    fn hand_over(&mut self, to: usize, from: usize, datagrams: &[Vec<u8>]) {
        for bytes in datagrams {
            self.tell(to, Input::Datagram { from: address(from), bytes: bytes.clone() });
        }
    }

    fn mesh(&self, robot: usize) -> Option<&Mesh> {
        self.robots[robot].brain().map(Brain::mesh)
    }
}
