//! From a scenario as written to the checked one.

use std::{
    path::{Path, PathBuf},
    time::Duration,
};

use sdr_core::{
    id::{Name, RobotId},
    units::{Bytes, Permille},
};

use super::{
    file::{LinkTable, RobotEntry, ScenarioFile},
    steps,
    types::{Action, BurstSettings, LinkSettings, RobotSetup, Scenario, Step, When},
    words::Robots,
};
use crate::{
    near::allowed_words,
    problem::Mark,
    read::{At, Map, Reader},
};

/// Most robots.
const ROBOTS_MAX: usize = 64;
/// Longest scenario: it runs in real time.
pub(super) const LONGEST: Duration = Duration::from_secs(30 * 60);
/// Memory of a robot that does not say: the demo's.
const MEMORY: Bytes = Bytes(1_900_000_000);
/// Charge of a robot that does not say.
const BATTERY: Permille = Permille(800);
/// Sizes of a small disk.
const DISK: std::ops::RangeInclusive<u64> = 1_000_000..=1_000_000_000;

/// What the steps of one scenario are checked against.
pub(super) struct Context<'a> {
    /// Where relative paths count from.
    pub(super) folder: &'a Path,
    pub(super) robots: Vec<RobotId>,
    pub(super) reader: &'a mut Reader,
}

/// The checked scenario; every problem is told to `reader`.
pub(super) fn checked(file: ScenarioFile, folder: &Path, reader: &mut Reader) -> Option<Scenario> {
    let robots = robots(file.robots.0, file.defaults.as_ref(), reader);
    let names = robots.iter().map(|robot| robot.name.clone()).collect();
    let mut context = Context { folder, robots: names, reader };
    let coordinator = file.coordinator.and_then(|at| context.robot(&at));
    let driven = file.world.and_then(|world| context.robot(&world.driven));
    let radio = file.radio.map(|table| {
        if let Some(robots) = &table.robots {
            let help = Some("take it out; a step `link` is for single robots".to_owned());
            context.reader.problem(robots.mark, "the radio at the start is for all robots", help);
        }
        context.link(&table)
    });
    let systems = file.systems.map(|at| at.value).unwrap_or_default();
    let systems = systems.iter().filter_map(|path| context.file(path)).collect();
    let mut steps = Vec::new();
    for entry in file.timeline.0.map(|at| at.value).unwrap_or_default() {
        steps.extend(steps::checked(&entry, &mut context));
    }
    steps.sort_by_key(|step| step.at);
    let over = steps.iter().map(end_of).max().unwrap_or_default();
    let ends = file.ends.map(|at| context.time(&at, over)).unwrap_or(over);
    let (gone_after, gossip_period) =
        file.mesh.map_or((None, None), |mesh| (mesh.gone_after, mesh.gossip_period));
    let robots = with_slow_disks(robots, &steps);
    let scenario = Scenario {
        name: file.scenario.0?.value.to_string(),
        about: file.about.map(|about| about.value).unwrap_or_default(),
        robots,
        coordinator,
        driven,
        systems,
        gone_after: gone_after.map(|at| at.value),
        gossip_period: gossip_period.map(|at| at.value),
        components_stay: file.on_agent_death.is_none_or(|word| word.value.0),
        radio: radio.unwrap_or_default(),
        steps,
        ends,
    };
    reader.is_clean().then_some(scenario)
}

/// When nothing more comes of a step.
fn end_of(step: &Step) -> Duration {
    let more = match &step.what {
        Action::Expect(expectation) => match expectation.when {
            When::Within(time) | When::Lasting(time) => time,
        },
        Action::Outage(_, _, lasting) | Action::Split(_, _, lasting) => lasting.unwrap_or_default(),
        Action::Power(_, back_after) => back_after.unwrap_or_default(),
        Action::Link(..)
        | Action::Move(..)
        | Action::Heal(_)
        | Action::Battery(..)
        | Action::Memory(..)
        | Action::Cpu(..)
        | Action::Signal(..)
        | Action::Start(_)
        | Action::PowerOn(_)
        | Action::DiskFull(..)
        | Action::DiskSlow(..)
        | Action::Faulty(..)
        | Action::Sdr { .. } => Duration::ZERO,
    };
    step.at + more
}

fn robots(
    entries: Option<At<Map<RobotEntry>>>,
    defaults: Option<&RobotEntry>,
    reader: &mut Reader,
) -> Vec<RobotSetup> {
    let Some(entries) = entries else { return Vec::new() };
    let count = entries.value.0.len();
    if count == 0 || count > ROBOTS_MAX {
        let help = Some(format!("allowed: 1 to {ROBOTS_MAX}"));
        reader.problem(entries.mark, format!("{count} robots"), help);
    }
    let mut robots = Vec::new();
    for (key, entry) in entries.value.0 {
        match RobotId::new(&key.value) {
            Ok(name) => robots.extend(entry.map(|own| robot(name, &own, defaults, reader))),
            Err(error) => reader.problem(key.mark, error.to_string(), None),
        }
    }
    robots
}

fn robot(
    name: RobotId,
    own: &RobotEntry,
    defaults: Option<&RobotEntry>,
    reader: &mut Reader,
) -> RobotSetup {
    fn first<T>(
        own: &RobotEntry,
        defaults: Option<&RobotEntry>,
        of: impl Fn(&RobotEntry) -> Option<T>,
    ) -> Option<T> {
        of(own).or_else(|| defaults.and_then(of))
    }
    let names = |list: At<Vec<At<Name>>>| list.value.into_iter().map(|at| at.value).collect();
    let battery = first(own, defaults, |entry| entry.battery.clone());
    let battery = battery.map_or(BATTERY, |at| share(&at, reader));
    let disk = first(own, defaults, |entry| entry.disk.clone());
    if let Some(disk) = disk.as_ref().filter(|disk| !DISK.contains(&disk.value.0)) {
        let help = Some("allowed: 1MB to 1GB".to_owned());
        reader.problem(disk.mark, format!("a disk of {} bytes", disk.value.0), help);
    }
    RobotSetup {
        name,
        memory: first(own, defaults, |entry| entry.memory.clone()).map_or(MEMORY, |at| at.value),
        cpu: first(own, defaults, |entry| entry.cpu.clone()).map(|at| at.value),
        battery,
        labels: first(own, defaults, |entry| entry.labels.clone())
            .map_or(Vec::new(), |at| at.value),
        devices: first(own, defaults, |entry| entry.devices.clone()).map_or(Vec::new(), names),
        place: first(own, defaults, |entry| entry.place.clone()).map(|at| at.value),
        disk: disk.map(|at| at.value),
        slows: false,
    }
}

fn with_slow_disks(mut robots: Vec<RobotSetup>, steps: &[Step]) -> Vec<RobotSetup> {
    for step in steps {
        if let Action::DiskSlow(name, _) = &step.what {
            robots.iter_mut().filter(|robot| robot.name == *name).for_each(|one| one.slows = true);
        }
    }
    robots
}

/// At most all.
fn share(at: &At<Permille>, reader: &mut Reader) -> Permille {
    if at.value.0 > 1000 {
        let help = Some("allowed: 0% to 100%".to_owned());
        reader.problem(at.mark, format!("{}% of all", f64::from(at.value.0) / 10.0), help);
    }
    at.value
}

impl Context<'_> {
    /// A robot of the scenario.
    pub(super) fn robot(&mut self, at: &At<RobotId>) -> Option<RobotId> {
        if self.robots.contains(&at.value) {
            return Some(at.value.clone());
        }
        self.unknown_robot(at.mark, at.value.as_str());
        None
    }

    /// Robots of the scenario, each once.
    pub(super) fn all(&mut self, robots: &At<Robots>) -> Vec<RobotId> {
        match &robots.value {
            Robots::All => self.robots.clone(),
            Robots::These(list) => {
                let mut found: Vec<RobotId> =
                    list.iter().filter_map(|one| self.robot(one)).collect();
                found.sort();
                found.dedup();
                found
            }
        }
    }

    pub(super) fn unknown_robot(&mut self, mark: Mark, found: &str) {
        let known: Vec<&str> = self.robots.iter().map(RobotId::as_str).collect();
        let help = Some(allowed_words(found, &known));
        self.reader.problem(mark, format!("`{found}` is no robot of this scenario"), help);
    }

    /// A time from `least` on.
    pub(super) fn time(&mut self, at: &At<Duration>, least: Duration) -> Duration {
        if !(least..=LONGEST).contains(&at.value) {
            let help = Some(format!("allowed: {least:?} to {LONGEST:?}"));
            self.reader.problem(at.mark, format!("{:?}", at.value), help);
        }
        at.value
    }

    pub(super) fn share(&mut self, at: &At<Permille>) -> Permille {
        share(at, self.reader)
    }

    /// A file that is there.
    pub(super) fn file(&mut self, at: &At<String>) -> Option<PathBuf> {
        let path = self.folder.join(&at.value);
        if path.is_file() {
            return Some(path);
        }
        let help = Some("paths count from the scenario's own folder".to_owned());
        self.reader.problem(at.mark, format!("no file {}", path.display()), help);
        None
    }

    pub(super) fn link(&mut self, table: &LinkTable) -> LinkSettings {
        let time = |at: &Option<At<Duration>>| at.as_ref().map(|at| at.value);
        let corners = table.corners.as_ref().map(|at| at.value);
        if let Some(at) = table.corners.as_ref().filter(|at| at.value > 20) {
            let help = Some("allowed: 0 to 20".to_owned());
            self.reader.problem(at.mark, format!("{} corners", at.value), help);
        }
        let bursts = table.bursts.as_ref().map(|bursts| BurstSettings {
            loss: self.share(&bursts.loss),
            every: time(&bursts.every).unwrap_or(Duration::from_secs(2)),
            lasting: time(&bursts.lasting).unwrap_or(Duration::from_millis(200)),
        });
        LinkSettings {
            level: table.level.as_ref().map(|at| at.value),
            over: table.over.as_ref().map(|at| self.time(at, Duration::ZERO)).unwrap_or_default(),
            loss: table.loss.as_ref().map(|at| self.share(at)),
            try_loss: table.try_loss.as_ref().map(|at| self.share(at)),
            bursts,
            delay: table.delay.as_ref().map(|at| self.time(at, Duration::ZERO)),
            jitter: table.jitter.as_ref().map(|at| self.time(at, Duration::ZERO)),
            rate: table.rate.as_ref().map(|at| at.value.0),
            queue: table.queue.as_ref().map(|at| at.value),
            corners,
        }
    }
}
