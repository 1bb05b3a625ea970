//! One try to place all items: bundle by bundle, each on the robot that the strategy picks.

use alloc::{format, vec, vec::Vec};

use sdr_core::{
    allocate::{Refusal, Tier},
    units::Bytes,
};

use crate::{
    board::Board,
    explain,
    facts::{Facts, Partner},
    feasible::Question,
    policy::Bars,
};

/// Most refusals that are kept for a component that found a home. One without a home keeps all.
const REFUSALS_MAX: usize = 16;

/// The part of an allocator that differs: in which order robots are asked, and which is taken.
pub(crate) trait Choose {
    /// All robots, in the order of asking.
    fn order(&self, facts: &Facts<'_>) -> Vec<usize>;

    /// How good a robot is for an item; `None` takes the first robot that fits.
    fn score(&self, facts: &Facts<'_>, board: &Board, item: usize, robot: usize) -> Option<i64>;
}

/// Which items go to one robot if any robot can take them.
#[derive(Clone, Copy, PartialEq, Eq)]
pub(crate) enum Bundling {
    /// Those whose system file says so.
    Asked,
    /// Also those that talk to each other.
    Talking,
}

/// Which bundle goes first.
#[derive(Clone, Copy, PartialEq, Eq)]
pub(crate) enum Order {
    /// As in the file.
    File,
    /// The one that needs most memory.
    LargestFirst,
    /// The one that needs least memory.
    SmallestFirst,
}

/// What a try places, under which bars, in which order.
#[derive(Clone, Copy)]
pub(crate) struct Approach<'a> {
    pub(crate) tier: Tier,
    pub(crate) bars: &'a Bars,
    pub(crate) bundling: Bundling,
    pub(crate) order: Order,
}

/// A finished try.
pub(crate) struct Attempt<'a> {
    pub(crate) approach: Approach<'a>,
    pub(crate) board: Board,
    /// Per item, when it has a home: memory left there after placing it, and who refused.
    pub(crate) made: Vec<Option<(Bytes, Vec<Refusal>)>>,
    facts: &'a Facts<'a>,
    /// Robots in the order of asking.
    robots: Vec<usize>,
}

/// What came of asking one robot for a bundle.
enum Answer {
    /// It fits, with this score.
    Fits(Option<i64>),
    /// This member does not fit, for these reasons.
    Refused(usize, Vec<Refusal>),
}

impl<'a> Attempt<'a> {
    /// Places what can be placed.
    pub(crate) fn run(facts: &'a Facts<'a>, choose: &impl Choose, approach: Approach<'a>) -> Self {
        let mut attempt = Self {
            approach,
            board: Board::new(facts),
            made: vec![None; facts.problem.items.len()],
            facts,
            robots: choose.order(facts),
        };
        for group in groups(facts, approach) {
            if attempt.place(choose, &group) {
                continue;
            }
            for bundle in split(group.clone(), |item| together(facts, item)) {
                if bundle.len() == group.len() || !attempt.place(choose, &bundle) {
                    for item in bundle {
                        attempt.place(choose, &[item]);
                    }
                }
            }
        }
        attempt
    }

    /// Whether every item has a home.
    pub(crate) fn whole(&self) -> bool {
        self.board.placed() == self.made.len()
    }

    /// Puts a whole bundle on the robot that the strategy picks; `false` when none can take it.
    fn place(&mut self, choose: &impl Choose, bundle: &[usize]) -> bool {
        let mut refused: Vec<(usize, Vec<Refusal>)> = Vec::new();
        let mut scored: Vec<(usize, i64)> = Vec::new();
        let mut chosen: Option<(usize, Option<i64>)> = None;
        let mut asked_running = false;
        for (robot, running) in self.asking_order(bundle) {
            // Where an instance runs already comes before anything that must be started.
            if asked_running && !running && chosen.is_some() {
                break;
            }
            asked_running = running;
            match self.ask(choose, bundle, robot) {
                Answer::Refused(member, reasons) => refused.push((member, reasons)),
                Answer::Fits(None) => {
                    chosen = Some((robot, None));
                    break;
                }
                Answer::Fits(Some(score)) => {
                    scored.push((robot, score));
                    let best = chosen.and_then(|(_, score)| score);
                    if best.is_none_or(|best| score > best) {
                        chosen = Some((robot, Some(score)));
                    }
                }
            }
        }
        let Some((robot, best)) = chosen else {
            return false;
        };
        for item in bundle {
            let needs = self.facts.needs[*item];
            let left = self.board.memory_left(self.facts, robot, needs.memory);
            self.board.place(*item, robot, needs);
            let mut reasons = self.reasons(*item, &refused);
            reasons.extend(self.outscored(&scored, robot, best));
            reasons.truncate(REFUSALS_MAX);
            self.made[*item] = Some((Bytes(u64::try_from(left).unwrap_or(0)), reasons));
        }
        true
    }

    /// Robots where members run already first, those with most members before the others.
    fn asking_order(&self, bundle: &[usize]) -> Vec<(usize, bool)> {
        let items = &self.facts.problem.items;
        let running = |robot: usize| {
            let id = &self.facts.robots[robot].robot;
            bundle.iter().filter(|item| items[**item].running_on.contains(id)).count()
        };
        let reuse = self.facts.policy.reuse_standbys;
        let mut order: Vec<(usize, usize)> = self
            .robots
            .iter()
            .map(|robot| (*robot, if reuse { running(*robot) } else { 0 }))
            .collect();
        order.sort_by_key(|(_, running)| usize::MAX - running);
        order.into_iter().map(|(robot, running)| (robot, running > 0)).collect()
    }

    /// Tries a bundle on a robot, and leaves the board as it was.
    fn ask(&mut self, choose: &impl Choose, bundle: &[usize], robot: usize) -> Answer {
        let (facts, bars) = (self.facts, self.approach.bars);
        let mut total: Option<i64> = None;
        let mut answer = None;
        let mut placed = 0;
        for item in bundle {
            let question = Question { facts, board: &self.board, bars, item: *item, robot };
            let failures = question.failures();
            if !failures.is_empty() {
                let words = failures.iter().map(|failure| explain::refusal(question, failure));
                answer = Some(Answer::Refused(*item, words.collect()));
                break;
            }
            if let Some(score) = choose.score(facts, &self.board, *item, robot) {
                total = Some(total.unwrap_or(0).saturating_add(score));
            }
            self.board.place(*item, robot, facts.needs[*item]);
            placed += 1;
        }
        for item in &bundle[..placed] {
            self.board.lift(*item, facts.needs[*item]);
        }
        answer.unwrap_or(Answer::Fits(total))
    }

    /// The refusals as they concern one member: those of another one say whose they are.
    fn reasons(&self, item: usize, refused: &[(usize, Vec<Refusal>)]) -> Vec<Refusal> {
        let mut reasons = Vec::new();
        for (member, refusals) in refused {
            for refusal in refusals.iter().take(REFUSALS_MAX.saturating_sub(reasons.len())) {
                let mut refusal = refusal.clone();
                if *member != item {
                    let name = &self.facts.problem.items[*member].component.name;
                    refusal.found = format!("{} with {name}", refusal.found);
                }
                reasons.push(refusal);
            }
        }
        reasons
    }

    /// Robots that fit but have no greater score.
    fn outscored(&self, scored: &[(usize, i64)], chosen: usize, best: Option<i64>) -> Vec<Refusal> {
        let robots = &self.facts.robots;
        let best = best.unwrap_or(0);
        let bar = |score: i64| {
            let (most, robot) = (thousandths(best), &robots[chosen].robot);
            match score == best {
                true => format!("more than {most}: {robot} has as much and is asked first"),
                false => format!("{most} on {robot}"),
            }
        };
        let others = scored.iter().filter(|(robot, _)| *robot != chosen).take(REFUSALS_MAX);
        others
            .map(|(robot, score)| Refusal {
                robot: robots[*robot].robot.clone(),
                constraint: "score".into(),
                found: thousandths(*score),
                bar: bar(*score),
            })
            .collect()
    }
}

fn thousandths(score: i64) -> alloc::string::String {
    format!("{}.{:03}", score / 1000, score % 1000)
}

/// Items in bundles, in the order in which they are placed.
fn groups(facts: &Facts<'_>, approach: Approach<'_>) -> Vec<Vec<usize>> {
    let all = (0..facts.problem.items.len()).collect();
    let mut groups = split(all, |item| {
        let mut related = together(facts, item);
        if approach.bundling == Bundling::Talking {
            related.extend(facts.partners[item].iter().filter_map(|partner| match partner {
                Partner::Item(other) => Some(*other),
                Partner::Settled(_) => None,
            }));
        }
        related
    });
    let memory = |group: &Vec<usize>| -> u128 {
        group.iter().map(|item| u128::from(facts.needs[*item].memory.0)).sum()
    };
    match approach.order {
        Order::File => {}
        Order::LargestFirst => groups.sort_by_key(|group| u128::MAX - memory(group)),
        Order::SmallestFirst => groups.sort_by_key(memory),
    }
    groups
}

/// Items that must be on the robot of this one, by what itself says.
fn together(facts: &Facts<'_>, item: usize) -> Vec<usize> {
    let items = &facts.problem.items;
    let wanted = &items[item].place.together_with;
    let others = items.iter().enumerate();
    others.filter(|(_, other)| wanted.contains(&other.component.name)).map(|(i, _)| i).collect()
}

/// Splits items into bundles of related ones; relations hold in both directions. The order is
/// that of the items.
fn split(items: Vec<usize>, related: impl Fn(usize) -> Vec<usize>) -> Vec<Vec<usize>> {
    let mut bundle_of: Vec<(usize, usize)> = items.iter().map(|item| (*item, *item)).collect();
    for item in &items {
        for other in related(*item) {
            let find = |wanted| bundle_of.iter().find(|(item, _)| *item == wanted).map(|(_, b)| *b);
            if let (Some(a), Some(b)) = (find(*item), find(other)) {
                let (keep, drop) = (a.min(b), a.max(b));
                for (_, bundle) in &mut bundle_of {
                    if *bundle == drop {
                        *bundle = keep;
                    }
                }
            }
        }
    }
    let mut bundles: Vec<(usize, Vec<usize>)> = Vec::new();
    for (item, bundle) in bundle_of {
        match bundles.iter_mut().find(|(name, _)| *name == bundle) {
            Some((_, members)) => members.push(item),
            None => bundles.push((bundle, vec![item])),
        }
    }
    bundles.into_iter().map(|(_, members)| members).collect()
}
