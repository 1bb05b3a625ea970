//! Carries out what the timeline says.

use std::{process::Stdio, time::Duration};

use sdr_core::id::RobotId;
use sdr_files::{
    Scenario,
    scenario::{Action, Blow, Cut, Target},
};
use sdr_lab::bed::{BedError, Whom};
use tokio::process::{Child, Command};

use super::{
    config::index_of,
    deeds,
    eyes::{Eyes, Seen},
    fleet::Fleet,
};
use crate::failure::Failure;

/// Something that is due later because of what was done.
#[derive(Clone, Debug)]
pub(super) enum Later {
    /// These robots hear again, unless they were cut off anew since.
    Hear(Vec<usize>),
    /// This split is over.
    Heal(String),
    /// These robots have power again.
    PowerOn(Vec<usize>),
}

/// What is due later, and after which time.
pub(super) type Due = Option<(Duration, Later)>;

/// An operator's command that runs.
pub(super) struct Running {
    pub(super) line: u32,
    pub(super) words: String,
    pub(super) fails: bool,
    pub(super) child: Child,
}

/// Does things to a fleet.
pub(super) struct Hands<'a> {
    pub(super) scenario: &'a Scenario,
    pub(super) fleet: Fleet,
    pub(super) commands: Vec<Running>,
}

impl Hands<'_> {
    fn index(&self, robot: &RobotId) -> usize {
        index_of(self.scenario, robot)
    }

    fn indices(&self, robots: &[RobotId]) -> Vec<usize> {
        robots.iter().map(|robot| self.index(robot)).collect()
    }

    /// Does it; what it entails comes with the time after which it is due.
    pub(super) fn act(&mut self, line: u32, action: &Action, eyes: &Eyes) -> Result<Due, Failure> {
        let now = self.fleet.bed.now();
        let mut later = None;
        match action {
            Action::Link(robots, settings) => {
                let change = deeds::link_change(settings);
                for robot in self.indices(robots) {
                    self.fleet.bed.air.lock().change(now, robot, &change);
                }
            }
            Action::Move(robot, place, over) => {
                let metres = |mm: i32| f64::from(mm) / 1000.0;
                let to = (metres(place.x_mm), metres(place.y_mm));
                self.fleet.bed.air.lock().place(now, self.index(robot), to, *over);
            }
            Action::Outage(robots, cut, lasting) => {
                later = self.outage(self.indices(robots), *cut, *lasting);
            }
            Action::Split(name, inside, lasting) => {
                self.split(name, &self.indices(inside));
                later = lasting.map(|lasting| (lasting, Later::Heal(name.clone())));
            }
            Action::Heal(name) => self.heal(name),
            Action::Battery(robot, to, over) => {
                let percent = f64::from(to.0) / 10.0;
                let robot = self.index(robot);
                self.fleet.bed.bodies.change(robot, |body| body.drain(now, percent, *over));
            }
            Action::Memory(robot, bytes) => {
                let left = bytes.0 + super::config::RESERVE_BYTES;
                let robot = self.index(robot);
                self.fleet.bed.bodies.change(robot, |body| body.memory_available_bytes = left);
            }
            Action::Cpu(robot, used) => {
                let cores = f64::from(used.0) / 1000.0;
                let robot = self.index(robot);
                self.fleet.bed.bodies.change(robot, |body| body.cpu_cores_used = cores);
            }
            Action::Signal(target, blow) => self.signal(target, *blow)?,
            Action::Start(robot) => self.start(self.index(robot), eyes)?,
            Action::Power(robots, back_after) => {
                later = self.power_off(self.indices(robots), *back_after, eyes);
            }
            Action::PowerOn(robots) => self.power_on(&self.indices(robots), eyes)?,
            Action::DiskFull(robot, full) => {
                let robot = self.index(robot);
                let state = self.fleet.places[robot].state.clone();
                self.fleet.bed.robots[robot].fill(&state, *full).map_err(tell)?;
            }
            Action::DiskSlow(robot, delay) => {
                let robot = self.index(robot);
                self.fleet.bed.robots[robot].slow(*delay).map_err(tell)?;
            }
            Action::Faulty(component, robot, order) => {
                self.order(component, robot.as_ref(), order, eyes)?;
            }
            Action::Sdr { robot, words, fails } => self.operate(line, robot, words, *fails)?,
            // Judged, not done.
            Action::Expect(_) => {}
        }
        Ok(later)
    }

    /// What is due now because of what was done before.
    pub(super) fn act_later(&mut self, later: &Later, eyes: &Eyes) -> Result<(), Failure> {
        match later {
            Later::Hear(robots) => {
                for robot in robots {
                    self.fleet.bed.air.lock().deafen(*robot, None);
                }
            }
            Later::Heal(name) => self.fleet.bed.air.lock().heal(name),
            Later::PowerOn(robots) => self.power_on(robots, eyes)?,
        }
        Ok(())
    }

    fn outage(&self, robots: Vec<usize>, cut: Cut, lasting: Option<Duration>) -> Due {
        for robot in &robots {
            self.fleet.bed.air.lock().deafen(*robot, Some(deeds::deaf(cut)));
        }
        lasting.map(|lasting| (lasting, Later::Hear(robots)))
    }

    fn split(&self, name: &str, inside: &[usize]) {
        let inside = (0..self.scenario.robots.len()).map(|robot| inside.contains(&robot));
        self.fleet.bed.air.lock().split(name, inside.collect());
    }

    fn power_off(&mut self, robots: Vec<usize>, back_after: Option<Duration>, eyes: &Eyes) -> Due {
        for robot in &robots {
            self.fleet.bed.robots[*robot].power_off();
            self.fleet.agents_on[*robot] = false;
            eyes.seen().forget(*robot);
        }
        back_after.map(|time| (time, Later::PowerOn(robots)))
    }

    fn heal(&self, name: &str) {
        let mut air = self.fleet.bed.air.lock();
        air.heal(name);
        let robot = self.scenario.robots.iter().position(|robot| robot.name.as_str() == name);
        if let Some(robot) = robot {
            air.deafen(robot, None);
        }
    }

    fn signal(&mut self, target: &Target, blow: Blow) -> Result<(), Failure> {
        let (robots, whom) = match target {
            Target::Agent(robot) => {
                let robot = self.index(robot);
                if matches!(blow, Blow::Kill | Blow::Term) {
                    self.fleet.agents_on[robot] = false;
                }
                (vec![robot], Whom::Agent)
            }
            Target::Component(name, robot) => {
                let robots = match robot {
                    Some(robot) => vec![self.index(robot)],
                    None => (0..self.scenario.robots.len()).collect(),
                };
                (robots, Whom::Component(name.clone()))
            }
        };
        let mut count = 0;
        for robot in robots {
            let robot = &mut self.fleet.bed.robots[robot];
            if robot.is_on() {
                count += robot.signal(whom.clone(), deeds::signal(blow)).map_err(tell)?;
            }
        }
        match count {
            0 => Err(Failure::new(format!("no process of {target:?} runs; nobody got the signal"))),
            _ => Ok(()),
        }
    }

    fn start(&mut self, robot: usize, eyes: &Eyes) -> Result<(), Failure> {
        eyes.seen().forget(robot);
        self.fleet.start_agent(robot).map_err(tell)
    }

    fn power_on(&mut self, robots: &[usize], eyes: &Eyes) -> Result<(), Failure> {
        for robot in robots {
            if !self.fleet.bed.robots[*robot].is_on() {
                self.start(*robot, eyes)?;
            }
        }
        Ok(())
    }

    /// Leaves the order where the component looks for it: on that robot, else at its home; one for
    /// always lies everywhere.
    fn order(
        &self,
        component: &str,
        robot: Option<&RobotId>,
        order: &str,
        eyes: &Eyes,
    ) -> Result<(), Failure> {
        let everywhere = order.split_whitespace().last() == Some("always");
        let seen = eyes.seen();
        for (index, places) in self.fleet.places.iter().enumerate() {
            let meant = match robot {
                Some(robot) => self.index(robot) == index,
                None => everywhere || is_home(&seen, index, component),
            };
            if !meant {
                continue;
            }
            let path = places.orders.join(component);
            sdr_lab::radio::write_whole(&path, order).map_err(|error| {
                Failure::new(format!("cannot write {}: {error}", path.display()))
            })?;
        }
        Ok(())
    }

    /// Starts `sdr` as an operator at a robot would.
    fn operate(
        &mut self,
        line: u32,
        robot: &RobotId,
        words: &[String],
        fails: bool,
    ) -> Result<(), Failure> {
        let program = std::env::current_exe()?;
        let child = Command::new(program)
            .arg("--agent")
            .arg(&self.fleet.places[self.index(robot)].socket)
            .args(words)
            .env("NO_COLOR", "1")
            .stdin(Stdio::null())
            .stdout(Stdio::piped())
            .stderr(Stdio::piped())
            .kill_on_drop(true)
            .spawn()?;
        self.commands.push(Running { line, words: words.join(" "), fails, child });
        Ok(())
    }
}

/// Whether a robot says that it is a component's home.
fn is_home(seen: &Seen, robot: usize, component: &str) -> bool {
    let Some(view) = seen.view(robot) else { return false };
    let components = view.systems.iter().flat_map(|system| &system.components);
    components
        .filter(|one| one.name == component)
        .any(|one| one.home.as_deref() == Some(view.seen_from.as_str()))
}

fn tell(error: BedError) -> Failure {
    Failure::new(error.to_string())
}
