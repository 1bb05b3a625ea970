//! Samples between processes. A steady flow changes nothing, so only what changed is looked
//! at: a new producer, a new consumer, a new route, a link that works again.

use std::time::Duration;

use sdr_core::{
    input::{Input, InstanceId, InstanceNews},
    lifecycle::LifecycleState,
    order::Token,
};

use super::{
    due::Due,
    fleet::{ActiveProcess, Fleet},
    process::Offered,
    sight::Sight,
};

/// From a change to the first sample behind it.
const FIRST: Duration = Duration::from_millis(20);
/// Time between two samples: one that was lost is followed by the next so much later.
const PERIOD: Duration = Duration::from_millis(66);
/// From a sample to the agent that hears of it.
const TOLD: Duration = Duration::from_millis(1);

impl Fleet {
    /// The samples of a component may reach others than before.
    pub(crate) fn flow_soon(&mut self, component: usize) {
        self.flow_after(component, FIRST);
    }

    /// Samples of all components on a robot, and those for it, may pass again.
    pub(crate) fn flow_at(&mut self, robot: usize) {
        let mut touched: Vec<usize> = Vec::new();
        for process in self.robots[robot].processes.values() {
            touched.push(process.number);
            touched.extend(process.inputs.iter().map(|(_, producer)| *producer));
        }
        touched.into_iter().for_each(|component| self.flow_soon(component));
    }

    fn flow_after(&mut self, component: usize, after: Duration) {
        if !self.flowing[component] {
            self.flowing[component] = true;
            self.queue.push(self.now + after, Due::Flow { component });
        }
    }

    /// Each active producer of a component offers a sample to each consumer it reaches.
    pub(crate) fn flow(&mut self, component: usize) {
        self.flowing[component] = false;
        let producers = self.actives[component].clone();
        let consumers = self.feeds[component].clone();
        let mut lost = false;
        for producer in &producers {
            if self.is_hung(producer) {
                continue;
            }
            for (robot, instance) in &consumers {
                lost |= self.offer(component, producer, *robot, *instance);
            }
        }
        if lost {
            self.flow_after(component, PERIOD);
        }
    }

    /// Whether chance took the sample on its way.
    fn offer(
        &mut self,
        component: usize,
        producer: &ActiveProcess,
        robot: usize,
        instance: InstanceId,
    ) -> bool {
        let Some(process) = self.robots[robot].processes.get(&instance) else { return false };
        if process.state != LifecycleState::Active {
            return false;
        }
        let fed = process.inputs.iter().filter(|(_, from)| *from == component);
        let wires: Vec<(u16, String)> =
            fed.map(|(wiring, _)| (wiring.connection, wiring.path.clone())).collect();
        let mut lost = false;
        for (connection, path) in wires {
            if producer.robot != robot {
                if !self.is_carried(producer, robot, &path) {
                    continue;
                }
                if self.air.loses(self.now, producer.robot, robot) {
                    lost = true;
                    continue;
                }
            }
            self.take(robot, instance, connection, &producer.token);
        }
        lost
    }

    /// Whether bridges and radio carry samples of this producer to another robot.
    fn is_carried(&self, producer: &ActiveProcess, to: usize, path: &str) -> bool {
        let out = self.robots[producer.robot].outs.get(path);
        out.is_some_and(|active| active.as_ref() == Some(&producer.token))
            && self.robots[to].ins.contains_key(path)
            && self.air.is_linked(producer.robot, to, self.now)
    }

    fn take(&mut self, robot: usize, instance: InstanceId, connection: u16, token: &Token) {
        let Some(process) = self.robots[robot].processes.get_mut(&instance) else { return };
        match process.offer(connection, token) {
            Offered::Refused => self.tally.fenced += 1,
            Offered::Known => {}
            Offered::Switched => {
                let token = token.clone();
                let news = InstanceNews::Heard { connection, token: token.clone() };
                self.sights.push(Sight::Accepted { robot, instance, connection, token });
                self.later(robot, TOLD, Input::Instance { instance, news });
            }
        }
    }

    fn is_hung(&self, producer: &ActiveProcess) -> bool {
        let processes = &self.robots[producer.robot].processes;
        processes.get(&producer.instance).is_none_or(|process| process.hung)
    }
}
