//! What can go wrong, and what operators do meanwhile.

use std::time::Duration;

use sdr_core::{
    fitness::RolePolicy, input::InstanceId, spec::SystemSpec, time::Instant, units::Dbm,
};

use super::{
    air::{Cut, Way, Weather},
    due::{Due, Over, Turn},
    fleet::Fleet,
    process::Behaviour,
    sight::Sight,
};

/// What becomes of a disk.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum DiskFate {
    /// It holds what was written.
    Kept,
    /// It is empty afterwards.
    Lost,
}

/// What a robot's monotonic clock does while its agent stands still.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum ClockFate {
    /// It goes on: the loop was late.
    Runs,
    /// It stands still too: the machine slept.
    Sleeps,
}

/// One fault, or one deed of an operator. Robots are numbers from 0; its sentence names them
/// from 1, as the robots call themselves.
#[derive(Debug, Clone, PartialEq)]
#[expect(missing_docs, reason = "the doc of each fault says what its fields are")]
pub enum Fault {
    /// Power fails, and comes back after `down`, if ever.
    Crash { robot: usize, down: Option<Duration>, disk: DiskFate },
    /// Power fails in the middle of the next write.
    CrashAtStore { robot: usize, down: Duration },
    /// The agent's loop stands still; components go on.
    Pause { robot: usize, time: Duration, clock: ClockFate },
    /// The radio hears and sends nothing.
    Deaf { robot: usize, time: Duration },
    /// Everybody's radio is bad.
    Storm { loss: f64, time: Duration },
    /// A wall round some robots.
    Cut { inside: Vec<usize>, way: Way, time: Duration },
    /// A wall round the coordinator, whoever it is then.
    CutOffCoordinator { time: Duration },
    /// Writes fail.
    DiskFull { robot: usize, time: Duration },
    /// Writes take long.
    DiskSlow { robot: usize, each: Duration, time: Duration },
    /// A process ends by itself.
    Exit { component: String },
    /// A process hangs.
    Hang { component: String },
    /// Processes of a component behave differently on one robot.
    Behave { robot: usize, component: String, behaviour: Behaviour, time: Duration },
    /// The radio level that a robot measures is low.
    Fade { robot: usize, level_dbm: i16, time: Duration },
    /// An operator deploys.
    Deploy { robot: usize, system: Box<SystemSpec> },
    /// An operator undeploys.
    Undeploy { robot: usize, system: sdr_core::id::Name },
    /// An operator gives the coordinator role to a robot.
    MoveRole { robot: usize, to: usize },
    /// An operator changes how the holder of the role is chosen.
    RolePolicy { robot: usize, policy: Box<RolePolicy> },
}

/// A fault and its moment, counted from the beginning.
#[derive(Debug, Clone, PartialEq)]
pub struct Incident {
    /// When.
    pub after: Duration,
    /// What.
    pub fault: Fault,
}

impl Fleet {
    /// A fault will strike at its moment.
    pub fn schedule(&mut self, incident: &Incident) {
        let at = super::fleet::BEGIN + incident.after;
        self.queue.push(at, Due::Fault(incident.fault.clone()));
    }

    /// A fault strikes now.
    pub fn strike(&mut self, fault: &Fault) {
        if self.setup.keeps_events {
            self.struck.push((self.now, fault.to_string()));
        }
        match fault {
            Fault::Crash { robot, down, disk } => self.crash(*robot, *down, *disk),
            Fault::CrashAtStore { robot, down } => {
                self.robots[*robot].crash_at_store = Some(*down);
            }
            Fault::Pause { robot, time, clock } => self.pause(*robot, *time, *clock),
            Fault::Deaf { robot, time } => {
                let until = self.now + *time;
                self.air.deafen(*robot, self.now, until);
                self.over_at(until, Over::Deaf(*robot));
            }
            Fault::Storm { loss, time } => {
                let before = self.air.weather.clone();
                self.air.weather = Weather { loss: *loss, ..before.clone() };
                self.over_at(self.now + *time, Over::Storm(before));
            }
            Fault::Cut { inside, way, time } => self.cut(inside, *way, *time),
            Fault::CutOffCoordinator { time } => {
                let holder = self.highest_coordinator();
                holder.into_iter().for_each(|robot| self.cut(&[robot], Way::Both, *time));
            }
            Fault::DiskFull { robot, time } => {
                self.robots[*robot].disk.full = true;
                self.over_at(self.now + *time, Over::DiskFull(*robot));
            }
            Fault::DiskSlow { robot, each, time } => {
                self.robots[*robot].disk.time = *each;
                self.over_at(self.now + *time, Over::DiskSlow(*robot));
            }
            Fault::Exit { component } => {
                self.turn_all(component, &Turn::Exit("killed by signal 9"));
            }
            Fault::Hang { component } => self.turn_all(component, &Turn::Hang),
            Fault::Behave { robot, component, behaviour, time } => {
                let behaviours = &mut self.robots[*robot].behaviours;
                behaviours.insert(component.clone(), behaviour.clone());
                self.over_at(self.now + *time, Over::Behaviour(*robot, component.clone()));
            }
            Fault::Fade { robot, level_dbm, time } => {
                self.robots[*robot].host.rssi = Some(Dbm::from_tenths(level_dbm * 10));
                self.over_at(self.now + *time, Over::Fade(*robot));
            }
            Fault::Deploy { robot, system } => self.deploy(*robot, system),
            Fault::Undeploy { robot, system } => self.undeploy(*robot, system),
            Fault::MoveRole { robot, to } => self.move_role(*robot, *to),
            Fault::RolePolicy { robot, policy } => self.set_role_policy(*robot, policy),
        }
        self.disturb(self.now);
    }

    pub(crate) fn end_fault(&mut self, over: Over) {
        match over {
            Over::Deaf(robot) => self.flow_at(robot),
            Over::Cut(id) => {
                self.air.cuts.retain(|cut| cut.id != id);
                self.sights.push(Sight::Healed);
                (0..self.robots.len()).for_each(|robot| self.flow_at(robot));
            }
            Over::DiskFull(robot) => self.robots[robot].disk.full = false,
            Over::DiskSlow(robot) => self.robots[robot].disk.time = super::disk::STORE_TIME,
            Over::Storm(before) => self.air.weather = before,
            Over::Behaviour(robot, word) => {
                self.robots[robot].behaviours.remove(&word);
            }
            Over::Fade(robot) => self.robots[robot].host.rssi = self.level_of(robot),
        }
        self.disturb(self.now);
    }

    /// Power fails now.
    pub(crate) fn crash(&mut self, robot: usize, down: Option<Duration>, disk: DiskFate) {
        if !self.robots[robot].is_on() {
            return;
        }
        self.switch_off(robot);
        if disk == DiskFate::Lost {
            self.robots[robot].disk.wipe();
        }
        self.robots[robot].is_lost = down.is_none();
        if let Some(down) = down {
            self.queue.push(self.now + down, Due::Start { robot });
        }
    }

    fn pause(&mut self, robot: usize, time: Duration, clock: ClockFate) {
        let until = self.now + time;
        let now = self.now;
        let paused = &mut self.robots[robot];
        if now >= paused.paused_until {
            paused.paused_at = now;
        }
        paused.paused_until = paused.paused_until.max(until);
        if clock == ClockFate::Sleeps {
            paused.clock.sleep(now, time);
        }
        self.disturb(until);
    }

    fn cut(&mut self, robots: &[usize], way: Way, time: Duration) {
        self.cuts += 1;
        let inside = (0..self.robots.len()).map(|robot| robots.contains(&robot)).collect();
        let until = self.now + time;
        self.air.cuts.push(Cut { id: self.cuts, inside, way, since: self.now, until });
        self.queue.push(until, Due::Over(Over::Cut(self.cuts)));
    }

    /// All walls fall.
    pub fn heal(&mut self) {
        self.air.cuts.clear();
        self.sights.push(Sight::Healed);
        (0..self.robots.len()).for_each(|robot| self.flow_at(robot));
        self.disturb(self.now);
    }

    /// All walls fall, all radios hear, all disks work, all robots that should are on: the
    /// end of the faults.
    pub fn calm(&mut self) {
        let now = self.now;
        self.air.cuts.clear();
        self.air.weather = Weather { loss: 0.0, burst_loss: 0.0, ..self.air.weather.clone() };
        for robot in &mut self.robots {
            robot.disk.full = false;
            robot.disk.time = super::disk::STORE_TIME;
            robot.behaviours.clear();
            robot.crash_at_store = None;
            robot.paused_until = now;
        }
        for robot in 0..self.robots.len() {
            self.air.hear(robot, now);
            self.robots[robot].host.rssi = self.level_of(robot);
            self.flow_at(robot);
            if !self.robots[robot].is_on() && !self.robots[robot].is_lost {
                self.switch_on(robot);
            }
        }
        self.steady_since = now;
        self.sights.push(Sight::Calm);
        if self.setup.keeps_events {
            self.struck.push((now, "faults are over".into()));
        }
    }

    fn over_at(&mut self, at: Instant, over: Over) {
        self.disturb(at);
        self.queue.push(at, Due::Over(over));
    }

    fn turn_all(&mut self, word: &str, turn: &Turn) {
        (0..self.robots.len()).for_each(|robot| self.turn_at(robot, word, turn));
    }

    fn turn_at(&mut self, robot: usize, word: &str, turn: &Turn) {
        for instance in self.robots[robot].instances_of(word) {
            self.turn(robot, instance, turn.clone());
        }
    }

    /// The processes of a component on a robot end by themselves.
    pub fn kill(&mut self, robot: usize, word: &str) {
        self.turn_at(robot, word, &Turn::Exit("killed by signal 9"));
    }

    /// One process ends by itself.
    pub fn end_process(&mut self, robot: usize, instance: InstanceId) {
        self.turn(robot, instance, Turn::Exit("killed by signal 9"));
    }

    /// The processes of a component on a robot stop answering.
    pub fn hang(&mut self, robot: usize, word: &str) {
        self.turn_at(robot, word, &Turn::Hang);
    }

    /// The level a robot measures when nothing fades.
    pub(crate) fn level_of(&self, robot: usize) -> Option<Dbm> {
        let level = self.air.level_dbm(robot)?;
        Some(Dbm::from_tenths(i16::try_from(crate::cast::rounded(level * 10.0)).unwrap_or(-1100)))
    }
}
