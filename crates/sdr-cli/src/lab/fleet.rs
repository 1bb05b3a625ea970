//! Robots of a scenario: folder, keys, bed, world, agents. Dropping it ends all of it.

use std::{
    fs,
    path::Path,
    time::{Duration, SystemTime, UNIX_EPOCH},
};

use sdr_core::id::RobotId;
use sdr_files::Scenario;
use sdr_keys::authority::Authority;
use sdr_lab::{
    World, WorldConfig, WorldHandle,
    bed::{Bed, BedError, Body, Program, RobotConfig},
    world::RobotPaths,
};

use super::{
    config::{self, Places, RESERVE_BYTES},
    deeds::link_change,
    leftovers,
};
use crate::{demo::Folder, failure::Failure, locate};

/// Where components look for orders: see `components/faulty/README.md`.
const ORDERS: &str = "FAULTY_ORDERS";
/// What has to be allowed, for a machine that refuses.
const NEEDS: &str = "\n  the lab makes network, mount and process namespaces and TAP devices: it needs root, or user \
     namespaces and access to /dev/net/tun; docs/lab.md says how";

/// See the module. Fields are dropped in this order.
pub(super) struct Fleet {
    pub(super) bed: Bed,
    _world: Option<WorldHandle>,
    pub(super) places: Vec<Places>,
    /// Robots whose agent should be running.
    pub(super) agents_on: Vec<bool>,
    program: Program,
    _lock: fs::File,
    _folder: Folder,
}

impl Fleet {
    /// Makes everything and starts no agent.
    pub(super) fn build(scenario: &Scenario, seed: u64) -> Result<Self, Failure> {
        let (program, programs) = (locate::agent()?, locate::folder()?);
        leftovers::remove(&std::env::temp_dir());
        let folder = Folder::new(leftovers::PREFIX)?;
        let lock =
            leftovers::hold(folder.path()).map_err(|error| tell("lock its folder", &error))?;
        let path = folder.path();
        let count = scenario.robots.len();
        let places: Vec<Places> = (0..count).map(|index| Places::new(path, index)).collect();
        let world = world(scenario, path, seed)?;
        let authority = authority(path)?;
        let mut configs = Vec::new();
        for (index, (robot, places)) in scenario.robots.iter().zip(&places).enumerate() {
            for folder in places.folders() {
                fs::create_dir_all(folder).map_err(|error| tell("make a folder", &error))?;
            }
            for device in &robot.devices {
                let file = places.own.join(format!("device-{device}"));
                fs::write(file, "").map_err(|error| tell("make a device", &error))?;
            }
            authority.add_robot(&robot.name, &places.keys)?;
            let devices =
                world.as_ref().map(|_| RobotPaths::new(&path.join("w"), robot.name.as_str()));
            let text = config::text(scenario, index, places, &programs, devices.as_ref());
            fs::write(&places.config, text).map_err(|error| tell("write robot.toml", &error))?;
            let battery = f64::from(robot.battery.0) / 10.0;
            configs.push(RobotConfig {
                name: robot.name.to_string(),
                folder: places.own.clone(),
                disk: robot.disk.map(|disk| (places.state.clone(), disk.0)),
                slows: robot.slows,
                body: Body::new(robot.memory.0 + RESERVE_BYTES, battery),
            });
        }
        let bed = Bed::start(configs, seed).map_err(|error| refusal(&error))?;
        let program = Program {
            path: program,
            arguments: Vec::new(),
            environment: Vec::new(),
            log: path.to_owned(),
        };
        let agents_on = vec![false; count];
        let fleet =
            Self { bed, _world: world, places, agents_on, program, _lock: lock, _folder: folder };
        fleet.set_up_radio(scenario);
        Ok(fleet)
    }

    /// Switches a robot on and starts its agent.
    pub(super) fn start_agent(&mut self, index: usize) -> Result<(), BedError> {
        let places = &self.places[index];
        let program = Program {
            arguments: vec!["--config".to_owned(), places.config.display().to_string()],
            environment: vec![(ORDERS.to_owned(), places.orders.display().to_string())],
            log: places.log.clone(),
            ..self.program.clone()
        };
        let robot = &mut self.bed.robots[index];
        robot.power_on()?;
        robot.start_agent(&program)?;
        self.agents_on[index] = true;
        Ok(())
    }

    /// Ends the agents in good order, so that they finish their recordings.
    pub(super) async fn stop(&mut self) {
        use sdr_lab::bed::{Signal, Whom};
        for robot in self.bed.robots.iter_mut().filter(|robot| robot.is_on()) {
            // One that ended, or that is stopped and deaf to this, is ended below.
            let _ = robot.signal(Whom::Agent, Signal::CONT);
            let _ = robot.signal(Whom::Agent, Signal::TERM);
        }
        let limit = tokio::time::Instant::now() + Duration::from_secs(5);
        for index in 0..self.bed.robots.len() {
            let robot = &mut self.bed.robots[index];
            let runs = self.agents_on[index] && robot.is_on();
            while runs && robot.agent_ended().is_none() && tokio::time::Instant::now() < limit {
                tokio::time::sleep(Duration::from_millis(20)).await;
            }
            robot.power_off();
        }
    }

    fn set_up_radio(&self, scenario: &Scenario) {
        let now = self.bed.now();
        let mut air = self.bed.air.lock();
        for (index, robot) in scenario.robots.iter().enumerate() {
            air.change(now, index, &link_change(&scenario.radio));
            if let Some(place) = robot.place {
                let metres = |mm: i32| f64::from(mm) / 1000.0;
                air.place(now, index, (metres(place.x_mm), metres(place.y_mm)), Duration::ZERO);
            }
        }
    }
}

fn world(scenario: &Scenario, folder: &Path, seed: u64) -> Result<Option<WorldHandle>, Failure> {
    let Some(driven) = &scenario.driven else { return Ok(None) };
    let others = scenario.robots.iter().filter(|robot| robot.name != *driven);
    let others: Vec<&str> = others.map(|robot| robot.name.as_str()).collect();
    let config = WorldConfig::convoy(&folder.join("w"), driven.as_str(), &others, seed);
    World::start(config).map(Some).map_err(|error| tell("make the world", &error))
}

/// Keys for one run.
fn authority(folder: &Path) -> Result<Authority, Failure> {
    let fleet = RobotId::new(&format!("lab-{:x}", std::process::id())).expect("a short name");
    let wall = SystemTime::now().duration_since(UNIX_EPOCH).unwrap_or_default();
    let (authority, _) = Authority::init(&folder.join("authority"), &fleet, wall)?;
    Ok(authority)
}

fn refusal(error: &BedError) -> Failure {
    let more = if error.is_refusal() { NEEDS } else { "" };
    Failure::new(format!("this machine refuses the lab's robots: {error}{more}"))
}

fn tell(what: &str, error: &dyn std::fmt::Display) -> Failure {
    Failure::new(format!("the lab cannot {what}: {error}"))
}
