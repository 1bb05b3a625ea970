//! Whether an item may go to a robot: Tables I and II, and what a system file asks of a place.

use alloc::vec::Vec;

use sdr_core::id::Name;

use crate::{
    board::Board,
    facts::{Facts, Link},
    policy::{Bars, BatteryBar},
};

/// One item on one robot, on a board where the item has no home.
#[derive(Clone, Copy)]
pub(crate) struct Question<'a> {
    pub(crate) facts: &'a Facts<'a>,
    pub(crate) board: &'a Board,
    pub(crate) bars: &'a Bars,
    pub(crate) item: usize,
    pub(crate) robot: usize,
}

/// A constraint that is not met, with the numbers that say so.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) enum Failure<'a> {
    /// The problem says not to go there, with the reason.
    Avoid(&'a str),
    /// It is pinned to another robot.
    Pinned,
    /// The robot lacks labels.
    Labels,
    /// The robot lacks parts of the body.
    Devices,
    /// The robot cannot launch it.
    Launch,
    /// This one is there and must not be.
    ApartFrom(&'a Name),
    /// This one is elsewhere and must not be.
    TogetherWith(&'a Name, usize),
    /// Memory left.
    Memory(i128),
    /// CPU in use, thousandths of the capacity.
    Cpu(u64),
    /// The charge, or that nobody can tell.
    Battery(BatteryBar),
    /// A bar of Table II, and the robot at the far end of the worst connection.
    Link(LinkBar, usize),
}

/// The bars of Table II.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(crate) enum LinkBar {
    Rssi,
    Jitter,
    Distance,
    Delay,
    Loss,
}

impl<'a> Question<'a> {
    /// All constraints that are not met, in a fixed order; at most one failure of each kind.
    pub(crate) fn failures(self) -> Vec<Failure<'a>> {
        let mut failures = Vec::new();
        self.judge_place(&mut failures);
        self.judge_company(&mut failures);
        self.judge_robot(&mut failures);
        if self.bars.judge_links() {
            self.judge_links(&mut failures);
        }
        failures
    }

    /// What the system file and the problem say about the place itself.
    fn judge_place(self, failures: &mut Vec<Failure<'a>>) {
        let item = &self.facts.problem.items[self.item];
        let offer = self.facts.robots[self.robot];
        if let Some((_, reason)) = item.avoid.iter().find(|(robot, _)| *robot == offer.robot) {
            failures.push(Failure::Avoid(reason));
        }
        let pinned = [&item.place.robot, &item.component.scope];
        if pinned.into_iter().flatten().any(|robot| *robot != offer.robot) {
            failures.push(Failure::Pinned);
        }
        if item.place.labels.iter().any(|label| !offer.labels.contains(label)) {
            failures.push(Failure::Labels);
        }
        if item.devices.iter().any(|device| !offer.devices.contains(device)) {
            failures.push(Failure::Devices);
        }
        if !offer.launchables.contains(&item.launch) {
            failures.push(Failure::Launch);
        }
    }

    /// Who must not, and who must, be on the same robot; whichever of the two says so.
    fn judge_company(self, failures: &mut Vec<Failure<'a>>) {
        let items = &self.facts.problem.items;
        let item = &items[self.item];
        let own = &item.component.name;
        let others = || {
            let homes = self.board.homes.iter();
            items.iter().zip(homes).filter_map(|(other, home)| home.map(|home| (other, home)))
        };
        let robots_of = |name| self.board.robots_of(self.facts, name);
        let apart = item
            .place
            .apart_from
            .iter()
            .find(|name| robots_of(name).any(|robot| robot == self.robot))
            .or_else(|| {
                let mut here = others().filter(|(_, home)| *home == self.robot);
                let other = here.find(|(other, _)| other.place.apart_from.contains(own))?;
                Some(&other.0.component.name)
            });
        failures.extend(apart.map(Failure::ApartFrom));
        let wanted = item.place.together_with.iter().find_map(|name| {
            let robot = robots_of(name).next()?;
            let here = robots_of(name).any(|robot| robot == self.robot);
            (!here).then_some(Failure::TogetherWith(name, robot))
        });
        failures.extend(wanted.or_else(|| {
            let mut there = others().filter(|(_, home)| *home != self.robot);
            let (other, home) = there.find(|(other, _)| other.place.together_with.contains(own))?;
            Some(Failure::TogetherWith(&other.component.name, home))
        }));
    }

    /// Table I.
    fn judge_robot(self, failures: &mut Vec<Failure<'a>>) {
        let needs = self.facts.needs[self.item];
        let left = self.board.memory_left(self.facts, self.robot, needs.memory);
        let bar = self.bars.memory_free_at_least.map_or(0, |bar| i128::from(bar.0));
        if left < bar {
            failures.push(Failure::Memory(left));
        }
        if let Some(bar) = self.bars.cpu_used_at_most {
            let used = self.cpu_used();
            if used > u64::from(bar.0) {
                failures.push(Failure::Cpu(used));
            }
        }
        let counts = |bar: &BatteryBar| bar.if_needs_cpu.is_none_or(|cpu| needs.cpu >= cpu);
        if let Some(bar) = self.bars.battery_at_least.filter(counts) {
            let charge = self.facts.battery(self.robot);
            if charge.is_none_or(|charge| charge < bar.at_least) {
                failures.push(Failure::Battery(bar));
            }
        }
    }

    /// CPU in use after placing, thousandths of the capacity, rounded up.
    fn cpu_used(self) -> u64 {
        let needs = self.facts.needs[self.item].cpu.0;
        let used = self.board.cpu_used(self.facts, self.robot, needs);
        let capacity = u64::from(self.facts.robots[self.robot].cpu_capacity.0);
        if capacity == 0 { u64::MAX } else { used.saturating_mul(1000).div_ceil(capacity) }
    }

    /// Table II, for every connection that would cross robots and whose far end is known.
    fn judge_links(self, failures: &mut Vec<Failure<'a>>) {
        let partners = &self.facts.partners[self.item];
        let mut far: Vec<usize> = partners
            .iter()
            .filter_map(|partner| self.board.far_end(*partner))
            .filter(|far| *far != self.robot)
            .collect();
        far.sort_unstable();
        far.dedup();
        let mut bad: Vec<(LinkBar, u64, usize)> = Vec::new();
        for far in far {
            let link = self.facts.link(self.robot, far);
            bad.extend(misses(self.bars, link).map(|(bar, by)| (bar, by, far)));
        }
        // Of each bar only the worst connection, the first by name among equals.
        bad.sort_by_key(|(bar, by, far)| (*bar, u64::MAX - by, *far));
        bad.dedup_by_key(|(bar, ..)| *bar);
        failures.extend(bad.into_iter().map(|(bar, _, far)| Failure::Link(bar, far)));
    }
}

/// The bars that a link misses, and by how much; unknown misses by most.
fn misses(bars: &Bars, link: Link) -> impl Iterator<Item = (LinkBar, u64)> {
    fn over(bar: Option<u64>, found: Option<u64>) -> Option<u64> {
        let bar = bar?;
        let by = found.map_or(u64::MAX, |found| found.saturating_sub(bar));
        (by > 0).then_some(by)
    }
    let nanos = |time: core::time::Duration| u64::try_from(time.as_nanos()).unwrap_or(u64::MAX);
    let depth = |level: sdr_core::units::Dbm| {
        // Turned round, so that more is worse here too.
        u64::try_from(i64::from(i16::MAX) - i64::from(level.tenths())).unwrap_or(0)
    };
    let millimetres = |distance: crate::policy::Millimetres| distance.0;
    let share = |share: sdr_core::units::Permille| u64::from(share.0);
    [
        (LinkBar::Rssi, over(bars.rssi_at_least.map(depth), link.rssi.map(depth))),
        (LinkBar::Jitter, over(bars.jitter_at_most.map(nanos), link.jitter.map(nanos))),
        (
            LinkBar::Distance,
            over(bars.distance_at_most.map(millimetres), link.distance.map(millimetres)),
        ),
        (LinkBar::Delay, over(bars.delay_at_most.map(nanos), link.delay.map(nanos))),
        (LinkBar::Loss, over(bars.loss_at_most.map(share), link.loss.map(share))),
    ]
    .into_iter()
    .filter_map(|(bar, by)| by.map(|by| (bar, by)))
}
