//! What happened, put together from all recordings: who was where, when, and who heard whom.

use std::collections::{BTreeMap, BTreeSet};

use sdr_core::recording::{ComponentSample, EventSample, RobotMetrics};

use super::{link::Link, read::Recordings};

/// An instance that was not heard of for so long is taken for ended.
const SILENCE_NS: u64 = 2_500_000_000;

/// One run of one or more systems.
#[derive(Debug, Default)]
pub(crate) struct Run {
    /// First moment recorded, CLOCK_MONOTONIC.
    pub(crate) from_ns: u64,
    /// Last moment recorded, or the end that was asked for.
    pub(crate) until_ns: u64,
    /// The systems seen.
    pub(crate) systems: BTreeSet<String>,
    /// Figures of each robot.
    pub(crate) robots: BTreeMap<String, Vec<RobotMetrics>>,
    /// Components in the order in which they were placed, else first seen.
    pub(crate) components: Vec<String>,
    /// Which state which instance was in, by time.
    pub(crate) stays: Vec<Stay>,
    /// Connections by name.
    pub(crate) links: BTreeMap<String, Link>,
    /// Samples sent by output.
    pub(crate) sent: BTreeMap<String, u64>,
    /// Events by time.
    pub(crate) events: Vec<EventSample>,
}

/// States that a report tells apart.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum State {
    /// Created or inactive: there, not at work.
    Inactive,
    /// At work.
    Active,
    /// In error.
    Error,
}

impl State {
    /// `None` for states in which there is no instance (any more).
    fn of(word: &str) -> Option<Self> {
        match word {
            "created" | "inactive" => Some(Self::Inactive),
            "active" => Some(Self::Active),
            "error" => Some(Self::Error),
            _ => None,
        }
    }
}

/// One instance in one state for a while.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Stay {
    /// The component.
    pub(crate) component: String,
    /// Where.
    pub(crate) robot: String,
    /// The state.
    pub(crate) state: State,
    /// From, CLOCK_MONOTONIC.
    pub(crate) from_ns: u64,
    /// Until, CLOCK_MONOTONIC.
    pub(crate) until_ns: u64,
    /// Number of the epoch; 0 while only prepared.
    pub(crate) epoch: u64,
    /// Activation within the epoch.
    pub(crate) run: u32,
}

/// A component that came to another robot.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Move {
    /// The component.
    pub(crate) component: String,
    /// The home before.
    pub(crate) from: String,
    /// The home after.
    pub(crate) to: String,
    /// The epoch after.
    pub(crate) epoch: u64,
    /// When the new instance became active, CLOCK_MONOTONIC.
    pub(crate) active_ns: u64,
}

impl Run {
    /// Puts it together; `until_ns` leaves out what came later (clearing up after a demo).
    pub(crate) fn new(recordings: &Recordings, until_ns: Option<u64>) -> Self {
        let limit = until_ns.unwrap_or(u64::MAX);
        let mut run = Self::default();
        let metrics = recordings.metrics.iter().filter(|message| message.monotonic_ns <= limit);
        for message in metrics {
            run.robots.entry(message.robot.clone()).or_default().push(message.clone());
        }
        run.events =
            recordings.events.iter().filter(|event| event.monotonic_ns <= limit).cloned().collect();
        let systems = recordings.components.iter().map(|sample| &sample.system);
        let systems = systems.chain(recordings.connections.iter().map(|sample| &sample.system));
        run.systems = systems.filter(|system| !system.is_empty()).cloned().collect();
        let times = times_of(recordings).filter(|at| *at <= limit);
        let (first, last) =
            times.fold((u64::MAX, 0), |(first, last), at| (first.min(at), last.max(at)));
        run.from_ns = first.min(last);
        run.until_ns = until_ns.unwrap_or(last).max(run.from_ns);
        run.stays = run.stays_of(recordings);
        run.components = run.components_in_order();
        for sample in recordings.connections.iter().filter(|sample| sample.monotonic_ns <= limit) {
            let name = run.name(&sample.system, &sample.connection);
            run.links.entry(name).or_default().add(sample);
        }
        run.count_outputs(recordings, limit);
        run
    }

    /// Seconds since the first moment.
    pub(crate) fn second(&self, at_ns: u64) -> f64 {
        seconds(at_ns) - seconds(self.from_ns)
    }

    /// A component's or port's name; with several systems the system stands before it.
    pub(crate) fn name(&self, system: &str, word: &str) -> String {
        if self.systems.len() > 1 && !system.is_empty() {
            format!("{system}/{word}")
        } else {
            word.to_owned()
        }
    }

    /// Active stays of a component, oldest epoch first.
    pub(crate) fn homes_of<'a>(&'a self, component: &'a str) -> Vec<&'a Stay> {
        let active = |stay: &&Stay| stay.component == component && stay.state == State::Active;
        let mut homes: Vec<&Stay> = self.stays.iter().filter(active).collect();
        homes.sort_by_key(|stay| (stay.epoch, stay.run, stay.from_ns));
        homes
    }

    /// All moves, oldest first.
    pub(crate) fn moves(&self) -> Vec<Move> {
        let mut moves = Vec::new();
        for component in &self.components {
            for pair in self.homes_of(component).windows(2) {
                if pair[0].robot != pair[1].robot {
                    moves.push(Move {
                        component: component.clone(),
                        from: pair[0].robot.clone(),
                        to: pair[1].robot.clone(),
                        epoch: pair[1].epoch,
                        active_ns: pair[1].from_ns,
                    });
                }
            }
        }
        moves.sort_by_key(|one| one.active_ns);
        moves
    }

    /// Where each component was at work at a moment; of two homes the one of the greater epoch.
    pub(crate) fn placement_at(&self, at_ns: u64) -> BTreeMap<String, String> {
        let mut placement = BTreeMap::new();
        for component in &self.components {
            let homes = self.homes_of(component);
            let there = |stay: &&&Stay| stay.from_ns <= at_ns && at_ns <= stay.until_ns;
            if let Some(home) = homes.iter().rfind(there) {
                placement.insert(component.clone(), home.robot.clone());
            }
        }
        placement
    }

    /// Events of one kind, by time.
    pub(crate) fn events_of<'a>(&'a self, kind: &'a str) -> impl Iterator<Item = &'a EventSample> {
        self.events.iter().filter(move |event| event.kind == kind)
    }

    fn stays_of(&self, recordings: &Recordings) -> Vec<Stay> {
        let mut instances: BTreeMap<(String, String), Vec<&ComponentSample>> = BTreeMap::new();
        for sample in &recordings.components {
            let name = self.name(&sample.system, &sample.component);
            instances.entry((name, sample.robot.clone())).or_default().push(sample);
        }
        let mut stays = Vec::new();
        for ((component, robot), samples) in instances {
            for (index, sample) in samples.iter().enumerate() {
                let Some(state) = State::of(&sample.state) else { continue };
                let next = samples.get(index + 1).map(|next| next.monotonic_ns);
                let silent = sample.monotonic_ns.saturating_add(SILENCE_NS);
                let until_ns = next.unwrap_or(self.until_ns).min(silent).min(self.until_ns);
                let stay = Stay {
                    component: component.clone(),
                    robot: robot.clone(),
                    state,
                    from_ns: sample.monotonic_ns,
                    until_ns,
                    epoch: sample.epoch,
                    run: sample.run,
                };
                if stay.from_ns <= self.until_ns {
                    join(&mut stays, stay);
                }
            }
        }
        stays.sort_by_key(|stay| stay.from_ns);
        stays
    }

    fn components_in_order(&self) -> Vec<String> {
        let placed = self.events_of("placed").chain(self.events_of("assigned"));
        let placed = placed.map(|event| self.name(&event.system, &event.component));
        let seen = self.stays.iter().map(|stay| stay.component.clone());
        let mut components = Vec::new();
        for name in placed.chain(seen) {
            if !name.is_empty() && !components.contains(&name) {
                components.push(name);
            }
        }
        components
    }

    /// Each instance counts from zero; a smaller count than before is another instance.
    fn count_outputs(&mut self, recordings: &Recordings, limit: u64) {
        let mut last: BTreeMap<(String, String), u64> = BTreeMap::new();
        for sample in recordings.outputs.iter().filter(|sample| sample.monotonic_ns <= limit) {
            let name = self.name(&sample.system, &sample.output);
            let before = last.entry((name.clone(), sample.robot.clone())).or_default();
            let new = if sample.sent >= *before { sample.sent - *before } else { sample.sent };
            *before = sample.sent;
            *self.sent.entry(name).or_default() += new;
        }
    }
}

/// Adds a stay, or lengthens the one before when it is the same.
fn join(stays: &mut Vec<Stay>, stay: Stay) {
    match stays.last_mut() {
        Some(last)
            if (&last.component, &last.robot, last.state, last.epoch, last.run)
                == (&stay.component, &stay.robot, stay.state, stay.epoch, stay.run)
                && last.until_ns >= stay.from_ns =>
        {
            last.until_ns = stay.until_ns;
        }
        Some(_) | None => stays.push(stay),
    }
}

/// Nanoseconds as seconds.
#[expect(clippy::cast_precision_loss, reason = "2^53 ns are 104 days, beyond that 1 us is lost")]
pub(crate) fn seconds(ns: u64) -> f64 {
    ns as f64 / 1e9
}

fn times_of(recordings: &Recordings) -> impl Iterator<Item = u64> {
    let metrics = recordings.metrics.iter().map(|message| message.monotonic_ns);
    let components = recordings.components.iter().map(|message| message.monotonic_ns);
    let connections = recordings.connections.iter().map(|message| message.monotonic_ns);
    let events = recordings.events.iter().map(|message| message.monotonic_ns);
    metrics.chain(components).chain(connections).chain(events)
}
