//! What operators ask of a robot.

use sdr_core::{fitness::RolePolicy, id::Name, input::Input, spec::SystemSpec};

use super::{fleet::Fleet, sight::Sight};

impl Fleet {
    /// Deploys on a robot; nothing happens while it is off.
    pub fn deploy(&mut self, robot: usize, system: &SystemSpec) {
        self.requests += 1;
        self.sights.push(Sight::Asked { robot, system: system.name.clone() });
        self.tell(robot, Input::Deploy { request: self.requests, system: system.clone() });
    }

    /// Undeploys on a robot; nothing happens while it is off.
    pub fn undeploy(&mut self, robot: usize, system: &Name) {
        self.requests += 1;
        self.sights.push(Sight::Asked { robot, system: system.clone() });
        self.tell(robot, Input::Undeploy { request: self.requests, system: system.clone() });
    }

    /// Gives the role to another robot, asked on `robot`; nothing happens while it is off.
    pub fn move_role(&mut self, robot: usize, to: usize) {
        self.requests += 1;
        let to = self.robots[to].id.clone();
        self.tell(robot, Input::MoveRole { request: self.requests, to });
    }

    /// Changes how the holder of the role is chosen; nothing happens while the robot is off.
    pub fn set_role_policy(&mut self, robot: usize, policy: &RolePolicy) {
        self.requests += 1;
        let policy = Box::new(policy.clone());
        self.tell(robot, Input::RolePolicy { request: self.requests, policy });
    }
}
