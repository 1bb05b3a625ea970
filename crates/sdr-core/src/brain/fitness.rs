//! How fit each robot is for the coordinator role, as this robot sees it.

use alloc::{format, vec::Vec};
use core::cmp::Reverse;

use super::Brain;
use crate::{
    fitness::{Figures, Fitness, RolePolicy},
    id::RobotId,
    record::{FleetValue, RecordKind},
    report::{LinkReport, RolePreference},
    units::Permille,
};

/// A link that loses more than this reaches nobody.
const REACHED_LOSS_MAX: Permille = Permille(500);

/// Orders candidates: the greatest is the first.
type Rank = (bool, bool, Reverse<usize>, u32, Reverse<RobotId>);

impl Brain {
    /// The policy of the role in force.
    pub(super) fn role_policy(&self) -> &RolePolicy {
        match self.mesh.fleet().get(RecordKind::ROLE_POLICY, "") {
            Some((_, FleetValue::RolePolicy(policy))) => policy,
            Some(_) | None => &self.config.role_policy,
        }
    }

    /// How fit a robot is, and why not.
    pub(super) fn fitness(&self, robot: &RobotId) -> Fitness {
        let mut fitness = self.role_policy().judge(&self.figures_for_role(robot));
        let trouble = || self.trouble_of(robot);
        fitness.unfit = fitness.unfit.or_else(trouble);
        fitness
    }

    /// Whether a robot may hold the role at all.
    pub(super) fn may_hold(&self, robot: &RobotId) -> bool {
        let preference = self.facts(robot).map(|facts| facts.role);
        preference.is_some_and(|role| role != RolePreference::Forbidden)
            && !self.role_policy().forbidden.contains(robot)
    }

    /// Robots that may hold the role, the best first: fit ones, preferred ones, pinned ones in
    /// their order, by points, by name.
    pub(super) fn candidates(&self) -> Vec<RobotId> {
        let mut ranked: Vec<Rank> = self
            .alive_robots()
            .into_iter()
            .filter(|robot| self.may_hold(robot))
            .map(|robot| self.rank(robot))
            .collect();
        ranked.sort_unstable_by(|a, b| b.cmp(a));
        ranked.into_iter().map(|(_, _, _, _, Reverse(robot))| robot).collect()
    }

    fn rank(&self, robot: RobotId) -> Rank {
        let fitness = self.fitness(&robot);
        let pin = self.role_policy().pin(&robot);
        (
            fitness.unfit.is_none(),
            self.prefers(&robot),
            Reverse(pin),
            fitness.coarse(),
            Reverse(robot),
        )
    }

    /// Whether robot.toml or the policy puts a robot before the others.
    pub(super) fn prefers(&self, robot: &RobotId) -> bool {
        let preference = self.facts(robot).map(|facts| facts.role);
        preference == Some(RolePreference::Preferred) || self.role_policy().pinned.contains(robot)
    }

    fn figures_for_role(&self, robot: &RobotId) -> Figures {
        let seen = self.figures_of(robot).unwrap_or_default();
        let capacity = self.facts(robot).map_or(0, |facts| facts.memory_capacity.0);
        let memory = seen.memory_free.filter(|_| capacity > 0).map(|free| {
            Permille(u32::try_from(free.0.saturating_mul(1000) / capacity).unwrap_or(1000))
        });
        let links = self.living_links(robot);
        let count = u32::try_from(links.len()).unwrap_or(u32::MAX);
        let sum: u32 = links.iter().map(|link| link.loss.0).sum();
        let reached = links.iter().filter(|link| link.loss <= REACHED_LOSS_MAX).count();
        // a robot tells of some of its links only: their share stands for all
        let share = u32::try_from(reached * 1000 / links.len().max(1)).unwrap_or(1000);
        Figures {
            battery: seen.battery,
            cpu: seen.cpu,
            memory,
            rssi: seen.rssi,
            loss: sum.checked_div(count).map(Permille),
            centrality: (count > 0).then_some(Permille(share.min(1000))),
        }
    }

    /// What a robot says of its links to robots that live.
    fn living_links(&self, robot: &RobotId) -> Vec<LinkReport> {
        let Some(author) = self.mesh.authors().author(robot) else { return Vec::new() };
        let links = author.links().filter(|(other, _)| self.mesh.is_alive(other));
        links.map(|(_, link)| *link).collect()
    }

    /// Trouble of the whole robot: a condition it told, foreseen ones too, or figures at which
    /// the recovery of a system would act. The role leaves before its holder is lost.
    fn trouble_of(&self, robot: &RobotId) -> Option<alloc::string::String> {
        let author = self.mesh.authors().author(robot);
        let mut told = author.into_iter().flat_map(|author| author.conditions());
        let told = told.find(|condition| condition.cause.is_of_robot());
        let told = told.map(|condition| format!("{}: {}", condition.cause, condition.reason));
        told.or_else(|| {
            let figures = self.figures_of(robot)?;
            let mut objectors = self.objectors.iter();
            objectors.find_map(|objector| Some(objector.engine.recovery().objection(&figures)?.1))
        })
    }
}
