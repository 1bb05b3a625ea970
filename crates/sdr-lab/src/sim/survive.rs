//! An agent dies and its machine goes on: processes stay, and the next agent adopts them.

use std::time::Duration;

use sdr_core::{
    input::{Adoption, Input, InstanceId, InstanceNews},
    lifecycle::LifecycleState,
};

use super::{
    disk::Written,
    due::{Due, Turn},
    fleet::Fleet,
    process::Process,
    sight::Sight,
};

/// From the start of an agent to the greeting of a process that outlived the one before.
const GREETING: Duration = Duration::from_millis(3);

impl Fleet {
    /// The agent of a robot dies; its processes go on among themselves.
    pub fn kill_agent(&mut self, robot: usize) {
        let written = match self.chance.happens(0.5) {
            true => Written::Whole,
            false => Written::NotAtAll,
        };
        self.robots[robot].disk.crash(written);
        self.robots[robot].leave_processes();
        self.disturb(self.now);
        self.sights.push(Sight::Off { robot });
    }

    /// The next agent starts there, and adopts what runs.
    pub fn start_agent(&mut self, robot: usize) {
        let shown = self.robots[robot].clock.show(self.now);
        self.robots[robot].start(self.now, shown, self.setup.robots, &self.pool);
        let disk_kept = self.robots[robot].disk.held().is_some();
        self.disturb(self.now);
        self.sights.push(Sight::On { robot, disk_kept });
        let survivors: Vec<(InstanceId, Process)> =
            self.robots[robot].processes.iter().map(|(id, one)| (*id, one.clone())).collect();
        for (instance, process) in survivors {
            self.adopt(robot, instance, process);
        }
        self.carry_out(robot);
        self.set_wake(robot);
        let life = self.robots[robot].life;
        self.queue.push(self.now + self.setup.host_period, Due::Sample { robot, life });
    }

    fn adopt(&mut self, robot: usize, instance: InstanceId, process: Process) {
        let inputs = process.inputs.into_iter().map(|(wiring, _)| wiring).collect();
        let pid = u32::try_from(instance).unwrap_or(u32::MAX);
        let adoption = Adoption { pid, component: process.component, spec: process.spec, inputs };
        let news = InstanceNews::Adopted(Box::new(adoption));
        self.tell(robot, Input::Instance { instance, news });
        if process.state == LifecycleState::Created {
            // What it was doing for the agent before, it does for this one.
            let life = self.robots[robot].life;
            let due = Due::Turn { robot, life, instance, turn: Turn::Idle };
            self.queue.push(self.now + GREETING, due);
        } else {
            let (state, token) = (process.state, process.token);
            let news = InstanceNews::State { state, token, fault: None };
            self.later(robot, GREETING, Input::Instance { instance, news });
        }
        for (connection, token) in process.heard {
            let news = InstanceNews::Heard { connection, token };
            self.later(robot, GREETING * 2, Input::Instance { instance, news });
        }
    }
}
