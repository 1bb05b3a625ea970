//! From a policy of the coordinator role as written to the checked one.

use sdr_core::{
    fitness::{RoleBars, RolePolicy, RoleWeights},
    id::RobotId,
};

use super::{
    find::{Finding, PolicyFile},
    role_file::{RoleBarsTable, RoleFile, RoleWeightsTable},
};
use crate::{
    problem::Mark,
    read::{At, Reader},
};

impl PolicyFile for RoleFile {
    type Policy = RolePolicy;
    const KIND: &'static str = "role";
    const BUILT_IN: &'static [(&'static str, &'static str)] =
        &[("default", include_str!("../../../../policies/role/default.yaml"))];

    fn standard() -> RolePolicy {
        RolePolicy::default()
    }

    fn checked(self, at: Finding<'_>, reader: &mut Reader) -> Option<RolePolicy> {
        let name = at.name(self.role.clone(), "role", reader);
        let mut policy = match &self.extends {
            Some(extends) => at.finder.named::<Self>(extends, reader)?,
            None => RolePolicy { bars: RoleBars::default(), ..RolePolicy::default() },
        };
        let robots: Vec<At<RobotId>> =
            [&self.pinned, &self.forbidden].into_iter().flatten().flatten().cloned().collect();
        apply(self, &mut policy);
        policy.name = name?;
        let mut named = robots.iter().rev().filter(|robot| is_both(&policy, &robot.value));
        let problems = policy.problems();
        for problem in &problems {
            let mark = match problem.key.split_once('.') {
                Some((above, key)) => at.mark(Some(above), key),
                None if problem.key == "forbidden" => {
                    named.next().map_or(at.tree.mark, |robot| robot.mark)
                }
                None => at.mark(None, problem.key),
            };
            tell(mark, problem.key, &problem.found, problem.allowed, reader);
        }
        problems.is_empty().then_some(policy)
    }
}

fn tell(mark: Mark, key: &str, found: &str, allowed: &str, reader: &mut Reader) {
    reader.problem(mark, format!("{key}: {found}"), Some(format!("allowed: {allowed}")));
}

fn is_both(policy: &RolePolicy, robot: &RobotId) -> bool {
    policy.pinned.contains(robot) && policy.forbidden.contains(robot)
}

/// Replaces `place` when the file says something.
fn set<T>(place: &mut T, given: Option<At<T>>) {
    if let Some(given) = given {
        *place = given.value;
    }
}

fn apply(file: RoleFile, policy: &mut RolePolicy) {
    if let Some(weights) = file.weights {
        apply_weights(weights, &mut policy.weights);
    }
    if let Some(bars) = file.bars {
        apply_bars(bars, &mut policy.bars);
    }
    for (place, given) in
        [(&mut policy.pinned, file.pinned), (&mut policy.forbidden, file.forbidden)]
    {
        if let Some(robots) = given {
            *place = robots.into_iter().map(|robot| robot.value).collect();
        }
    }
    set(&mut policy.margin, file.margin.map(|at| at.map(|points| points.0)));
    set(&mut policy.margin_for, file.margin_for);
    set(&mut policy.beat, file.beat);
    set(&mut policy.misses, file.misses.map(|at| at.map(|misses| misses.0)));
    set(&mut policy.stagger, file.stagger);
    set(&mut policy.alone, file.alone);
}

fn apply_weights(given: RoleWeightsTable, weights: &mut RoleWeights) {
    set(&mut weights.battery, given.battery);
    set(&mut weights.cpu, given.cpu);
    set(&mut weights.memory, given.memory);
    set(&mut weights.links, given.links);
    set(&mut weights.centrality, given.centrality);
}

fn apply_bars(given: RoleBarsTable, bars: &mut RoleBars) {
    set(&mut bars.battery_min, given.battery.map(|at| at.map(|bar| bar.0)));
    set(&mut bars.cpu_max, given.cpu_used.map(|at| at.map(|bar| bar.0)));
    set(&mut bars.memory_min, given.memory_free.map(|at| at.map(|bar| bar.0)));
    set(&mut bars.rssi_min, given.rssi.map(|at| at.map(|bar| bar.0)));
    set(&mut bars.loss_max, given.loss.map(|at| at.map(|bar| bar.0)));
}
