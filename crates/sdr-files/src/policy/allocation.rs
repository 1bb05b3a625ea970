//! From an allocation policy as written to the checked one.

use sdr_alloc::{Bars, IfUnknown, Policy, PolicyError, Unknown, Weights};

use super::{
    allocation_file::{
        AllocationChanges, AllocationFile, LinkBars, RobotBars, ScoreTable, UnknownTable,
    },
    bars::UnknownElse,
    find::{Finding, PolicyFile},
};
use crate::{
    problem::Mark,
    read::{At, Reader},
};

impl PolicyFile for AllocationFile {
    type Policy = Policy;
    const KIND: &'static str = "allocation";
    const BUILT_IN: &'static [(&'static str, &'static str)] = &[
        ("default", include_str!("../../../../policies/allocation/default.yaml")),
        ("exploration", include_str!("../../../../policies/allocation/exploration.yaml")),
    ];

    fn standard() -> Policy {
        Policy::default()
    }

    fn checked(self, at: Finding<'_>, reader: &mut Reader) -> Option<Policy> {
        let own = self.own();
        let first_own = self.first_own();
        let name = at.name(self.allocation, "allocation", reader);
        let (mut policy, changes) = match (self.extends, self.r#override) {
            (Some(extends), changes) => {
                if let Some(key) = first_own {
                    let message = format!("`{key}` stands beside `extends`");
                    let help = String::from("what differs stands under `override`");
                    reader.problem(at.mark(None, key), message, Some(help));
                }
                let base = at.finder.named::<Self>(&extends, reader)?;
                (base, changes.map(|changes| changes.value))
            }
            (None, Some(changes)) => {
                let message = "`override` without `extends`";
                let help = String::from("allowed: `extends: default`, or the keys at the top");
                reader.problem(changes.mark, message, Some(help));
                return None;
            }
            (None, None) => {
                let blank = Policy { strict: Bars::none(), relaxed: None, ..Policy::default() };
                (blank, Some(own))
            }
        };
        if let Some(changes) = changes {
            apply(changes, &mut policy);
        }
        policy.name = name?;
        if let Err(error) = policy.check() {
            reader.problem(place(&error, &at), error.to_string(), None);
            return None;
        }
        Some(policy)
    }
}

fn place(error: &PolicyError, at: &Finding<'_>) -> Mark {
    match error {
        PolicyError::TooGreat { key, .. } => at.mark(None, key),
        PolicyError::RelaxedStricter { key } => at.mark(Some("relaxed"), key),
        PolicyError::RobotTwice(_) => at.mark(None, "start_with"),
        PolicyError::Unreadable | PolicyError::Version { .. } | _ => at.tree.mark,
    }
}

/// Replaces `place` when the file says something.
fn set<T>(place: &mut T, given: Option<At<T>>) {
    if let Some(given) = given {
        *place = given.value;
    }
}

fn apply(changes: AllocationChanges, policy: &mut Policy) {
    set(&mut policy.strategy, changes.strategy);
    set(&mut policy.start_with, changes.start_with);
    set(&mut policy.reuse_standbys, changes.reuse_standbys);
    apply_robot(changes.robot, &mut policy.strict);
    apply_link(changes.link, &mut policy.strict);
    if let Some(relaxed) = changes.relaxed {
        let bars = policy.relaxed.get_or_insert(Bars::none());
        apply_robot(relaxed.robot, bars);
        apply_link(relaxed.link, bars);
    }
    if let Some(unknown) = changes.unknown {
        apply_unknown(unknown, &mut policy.unknown);
    }
    if let Some(needs) = changes.default_needs {
        set(&mut policy.default_needs.memory, needs.memory);
        set(&mut policy.default_needs.cpu, needs.cpu);
    }
    if let Some(score) = changes.score {
        apply_score(score, &mut policy.weights);
    }
}

fn apply_robot(given: Option<RobotBars>, bars: &mut Bars) {
    let Some(given) = given else { return };
    set(&mut bars.cpu_used_at_most, given.cpu_used.map(|at| at.map(|bar| bar.0)));
    set(&mut bars.memory_free_at_least, given.memory_free.map(|at| at.map(|bar| bar.0)));
    set(&mut bars.battery_at_least, given.battery.map(|at| at.map(|bar| bar.0)));
}

fn apply_link(given: Option<LinkBars>, bars: &mut Bars) {
    let Some(given) = given else { return };
    set(&mut bars.rssi_at_least, given.rssi.map(|at| at.map(|bar| bar.0)));
    set(&mut bars.jitter_at_most, given.jitter.map(|at| at.map(|bar| bar.0)));
    set(&mut bars.distance_at_most, given.distance.map(|at| at.map(|bar| bar.0)));
    set(&mut bars.delay_at_most, given.delay.map(|at| at.map(|bar| bar.0)));
    set(&mut bars.loss_at_most, given.loss.map(|at| at.map(|bar| bar.0)));
}

fn apply_unknown(given: UnknownTable, unknown: &mut Unknown) {
    match given.default.map(|at| at.value) {
        None => {}
        Some(UnknownElse::Refuse) => *unknown = Unknown::default(),
        Some(UnknownElse::Worst) => {
            *unknown = Unknown {
                battery: IfUnknown::Worst,
                rssi: IfUnknown::Worst,
                jitter: IfUnknown::Worst,
                distance: IfUnknown::Worst,
                delay: IfUnknown::Worst,
                loss: IfUnknown::Worst,
            };
        }
    }
    set(&mut unknown.battery, given.battery);
    set(&mut unknown.rssi, given.rssi);
    set(&mut unknown.jitter, given.jitter);
    set(&mut unknown.distance, given.distance);
    set(&mut unknown.delay, given.delay);
    set(&mut unknown.loss, given.loss);
}

fn apply_score(given: ScoreTable, weights: &mut Weights) {
    set(&mut weights.memory_left, given.memory_left);
    set(&mut weights.cpu_left, given.cpu_left);
    set(&mut weights.battery, given.battery);
    set(&mut weights.link_quality, given.link_quality);
    set(&mut weights.nearness, given.nearness);
    set(&mut weights.stay, given.stay);
}
