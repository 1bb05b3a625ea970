//! Who is placed where so far, and what that leaves.

use alloc::{vec, vec::Vec};

use sdr_core::{id::Name, spec::Needs, units::Bytes};

use crate::facts::{Facts, Partner};

/// An unfinished placement.
#[derive(Clone)]
pub(crate) struct Board {
    /// Per item its robot.
    pub(crate) homes: Vec<Option<usize>>,
    /// Per robot what the items placed there need.
    taken: Vec<Taken>,
}

#[derive(Clone, Copy, Default)]
struct Taken {
    memory: u64,
    cpu: u64,
}

impl Board {
    pub(crate) fn new(facts: &Facts<'_>) -> Self {
        let homes = vec![None; facts.problem.items.len()];
        Self { homes, taken: vec![Taken::default(); facts.robots.len()] }
    }

    /// Puts an item, which has no home yet, on a robot.
    pub(crate) fn place(&mut self, item: usize, robot: usize, needs: Needs) {
        assert!(self.homes[item].is_none(), "an item is placed once");
        self.homes[item] = Some(robot);
        let taken = &mut self.taken[robot];
        taken.memory = taken.memory.saturating_add(needs.memory.0);
        taken.cpu = taken.cpu.saturating_add(u64::from(needs.cpu.0));
    }

    /// Takes an item off its robot again.
    pub(crate) fn lift(&mut self, item: usize, needs: Needs) {
        let robot = self.homes[item].take().expect("only placed items are lifted");
        let taken = &mut self.taken[robot];
        taken.memory = taken.memory.saturating_sub(needs.memory.0);
        taken.cpu = taken.cpu.saturating_sub(u64::from(needs.cpu.0));
    }

    /// How many items have a home.
    pub(crate) fn placed(&self) -> usize {
        self.homes.iter().flatten().count()
    }

    /// Memory that is left on a robot once `more` runs there too; below zero when it is short.
    pub(crate) fn memory_left(&self, facts: &Facts<'_>, robot: usize, more: Bytes) -> i128 {
        let free = facts.robots[robot].memory_free.0;
        i128::from(free) - i128::from(self.taken[robot].memory) - i128::from(more.0)
    }

    /// CPU in use on a robot once `more` thousandths of a core run there too.
    pub(crate) fn cpu_used(&self, facts: &Facts<'_>, robot: usize, more: u32) -> u64 {
        let offer = facts.robots[robot];
        let before = offer.cpu_capacity.0.saturating_sub(offer.cpu_free.0);
        u64::from(before).saturating_add(self.taken[robot].cpu).saturating_add(u64::from(more))
    }

    /// The robot at the far end of a connection, when it is known by now.
    pub(crate) fn far_end(&self, partner: Partner) -> Option<usize> {
        match partner {
            Partner::Settled(robot) => Some(robot),
            Partner::Item(item) => self.homes[item],
        }
    }

    /// Robots where a component of that name is or will be, as far as is known by now.
    pub(crate) fn robots_of<'a>(
        &'a self,
        facts: &'a Facts<'_>,
        name: &'a Name,
    ) -> impl Iterator<Item = usize> + 'a {
        let items = facts.problem.items.iter().zip(&self.homes);
        items
            .filter(move |(item, _)| item.component.name == *name)
            .filter_map(|(_, home)| *home)
            .chain(facts.settled(name))
    }
}
