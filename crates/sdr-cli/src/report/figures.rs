//! The figures of a run: how long the activation and the recovery took, and what the streams felt.

use std::collections::BTreeMap;

use super::{
    extra::{Extra, TruthPoint},
    link::{Counts, Link, Pause},
    page::duration,
    read::Fix,
    run::{Move, Run},
};

/// A trouble explains a move when it was seen at most this long before.
const CAUSE_WITHIN_NS: u64 = 30_000_000_000;
/// How long after the recovery its effects on streams are looked for: drains end within 1 s.
const AFTER_NS: u64 = 1_500_000_000;
/// Truth and estimate further apart in time are not compared.
const TRUTH_WITHIN_NS: u64 = 200_000_000;

/// What became of a connection's samples; `sent` is `received`, `lost` and `unheard` together.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Traffic {
    /// By its output.
    pub(crate) sent: Option<u64>,
    /// At its consumers.
    pub(crate) counts: Counts,
    /// Sent while no consumer listened or took them.
    pub(crate) unheard: Option<u64>,
}

impl Traffic {
    /// Producer and consumer are read at different moments: what a consumer knows of was sent,
    /// though the producer's counter may not say so yet.
    fn new(sent: Option<u64>, counts: Counts) -> Self {
        let known = counts.received + counts.lost;
        let sent = sent.map(|sent| sent.max(known));
        Self { sent, counts, unheard: sent.map(|sent| sent - known) }
    }
}

/// See the module. `None` is unknown.
#[derive(Debug, Default)]
pub(crate) struct Figures {
    /// When the deployment was accepted.
    pub(crate) deployed_ns: Option<u64>,
    /// From there until all is active and the first sample is accepted on every connection.
    pub(crate) activation_ns: Option<u64>,
    /// What keeps the activation from being complete.
    pub(crate) not_activated: Vec<String>,
    /// When the hold time of the trouble was over, or a robot was taken for gone.
    pub(crate) trouble_ns: Option<u64>,
    /// When the change began: the trouble, or that it was foreseen and a next home got ready.
    pub(crate) change_ns: Option<u64>,
    /// The moves that followed from it.
    pub(crate) moves: Vec<Move>,
    /// From the trouble until the moved components are active and heard.
    pub(crate) recovery_ns: Option<u64>,
    /// What keeps the recovery from being complete.
    pub(crate) not_recovered: Vec<String>,
    /// Pauses around the moves, by connection.
    pub(crate) pauses: BTreeMap<String, Option<Pause>>,
    /// Pause of the commands around the moves.
    pub(crate) commands: Option<Pause>,
    /// Where components were before any move.
    pub(crate) placement_before: BTreeMap<String, String>,
    /// Where they were at the end.
    pub(crate) placement_after: BTreeMap<String, String>,
    /// Epochs at the end.
    pub(crate) epochs: BTreeMap<String, u64>,
    /// Samples by connection.
    pub(crate) samples: BTreeMap<String, Traffic>,
    /// Mean and largest distance between estimate and truth, metres.
    pub(crate) position_error_m: Option<(f64, f64)>,
    /// Verdicts of the detector, and those of danger among them.
    pub(crate) verdicts: Option<(u64, u64)>,
}

impl Figures {
    /// Works them out.
    pub(crate) fn new(run: &Run, fixes: &[Fix], extra: &Extra) -> Self {
        let mut figures = Self {
            deployed_ns: run.events_of("deployed").map(|event| event.monotonic_ns).min(),
            ..Self::default()
        };
        figures.find_activation(run, extra);
        figures.find_recovery(run);
        figures.find_pauses(run, extra);
        figures.find_placements(run);
        for (name, link) in &run.links {
            let output = name.split(" -> ").next().unwrap_or(name);
            let traffic = Traffic::new(run.sent.get(output).copied(), link.counts());
            figures.samples.insert(name.clone(), traffic);
        }
        figures.position_error_m = position_error(fixes, extra);
        figures
    }

    /// From when until when the streams are looked at: around the change, else nothing.
    pub(crate) fn window_ns(&self, run: &Run) -> Option<(u64, u64)> {
        let trouble = self.trouble_ns?;
        let last = self.moves.iter().map(|one| one.active_ns).max()?;
        let done = self.recovery_ns.map_or(last, |recovery| trouble + recovery);
        let from = self.change_ns.unwrap_or(trouble);
        Some((from, done.saturating_add(AFTER_NS).min(run.until_ns)))
    }

    /// A sentence for each stream that paused for longer than it may.
    pub(crate) fn too_long(&self) -> impl Iterator<Item = String> {
        let pauses = self.pauses.iter().filter_map(|(name, pause)| Some((name, (*pause)?)));
        pauses.filter_map(|(name, pause)| {
            let (gap, bar) = (duration(pause.gap_max_ns), duration(pause.over_ns()?));
            Some(format!("{name} paused for {gap} around the move; at most {bar} wanted"))
        })
    }

    fn find_activation(&mut self, run: &Run, extra: &Extra) {
        let Some(deployed) = self.deployed_ns else { return };
        let mut done = deployed;
        for component in with(&extra.components, &run.components) {
            let homes = run.homes_of(component);
            let active = homes.iter().map(|stay| stay.from_ns).filter(|at| *at >= deployed).min();
            match active {
                Some(at) => done = done.max(at),
                None => self.not_activated.push(format!("{component} never active")),
            }
        }
        for connection in with(&extra.connections, run.links.keys()) {
            match run.links.get(connection).and_then(|link| link.first_ns()) {
                Some(at) => done = done.max(at),
                None => self.not_activated.push(format!("no sample on {connection}")),
            }
        }
        let any = !run.stays.is_empty();
        self.activation_ns = (any && self.not_activated.is_empty()).then(|| done - deployed);
    }

    fn find_recovery(&mut self, run: &Run) {
        let moves = run.moves();
        let Some(first) = moves.first() else { return };
        let explains = |at: &u64| {
            *at <= first.active_ns && at.saturating_add(CAUSE_WITHIN_NS) >= first.active_ns
        };
        let raised = run.events_of("condition-raised").map(|event| {
            let over = number(event, "held_over_ns").map_or(event.monotonic_ns, whole);
            over.min(event.monotonic_ns)
        });
        let gone = run.events_of("robot-gone").map(|event| event.monotonic_ns);
        self.trouble_ns = raised.chain(gone).filter(explains).min();
        let Some(trouble) = self.trouble_ns else {
            self.moves = moves;
            self.not_recovered.push("no event says why the move was made".to_owned());
            return;
        };
        let limit = trouble.saturating_add(CAUSE_WITHIN_NS);
        self.moves = moves.into_iter().filter(|one| one.active_ns <= limit).collect();
        self.change_ns = Some(change_began(run, trouble, &self.moves));
        let mut done = trouble;
        for one in &self.moves {
            done = done.max(one.active_ns);
            let outputs = format!("{}.", one.component);
            for (name, link) in run.links.iter().filter(|(name, _)| name.starts_with(&outputs)) {
                match heard_ns(run, name, link, one.epoch) {
                    Some(at) => done = done.max(at),
                    None => self.not_recovered.push(format!("{name}: new home never heard")),
                }
            }
        }
        self.recovery_ns = self.not_recovered.is_empty().then(|| done - trouble);
    }

    fn find_pauses(&mut self, run: &Run, extra: &Extra) {
        let Some((from, until)) = self.window_ns(run) else { return };
        for (name, link) in &run.links {
            self.pauses.insert(name.clone(), link.pause(from, until));
        }
        self.commands = command_pause(&extra.commands_ns, from, until);
    }

    fn find_placements(&mut self, run: &Run) {
        for component in &run.components {
            let homes = run.homes_of(component);
            let first_move = self.moves.iter().find(|one| one.component == *component);
            let before = match (first_move, homes.first()) {
                (Some(one), _) => Some(&one.from),
                (None, Some(stay)) => Some(&stay.robot),
                (None, None) => None,
            };
            if let Some(robot) = before {
                self.placement_before.insert(component.clone(), robot.clone());
            }
            if let Some(last) = homes.last() {
                self.epochs.insert(component.clone(), last.epoch);
            }
        }
        self.placement_after = run.placement_at(run.until_ns);
    }
}

/// The names of the system, or those that were seen when it is unknown.
fn with<'a>(known: &'a [String], seen: impl IntoIterator<Item = &'a String>) -> Vec<&'a String> {
    if known.is_empty() { seen.into_iter().collect() } else { known.iter().collect() }
}

/// A figure of an event.
pub(crate) fn number(event: &sdr_core::recording::EventSample, name: &str) -> Option<f64> {
    let index = event.number_names.iter().position(|word| word == name)?;
    event.number_values.get(index).copied().filter(|value| value.is_finite())
}

/// When the next homes of these moves began to get ready, which may be before the trouble stood.
fn change_began(run: &Run, trouble: u64, moves: &[Move]) -> u64 {
    let about = |event: &&sdr_core::recording::EventSample| {
        let name = run.name(&event.system, &event.component);
        moves.iter().any(|one| one.component == name)
    };
    let foreseen = run.events_of("move-foreseen").filter(about).map(|event| event.monotonic_ns);
    let explains = |at: &u64| *at <= trouble && at.saturating_add(CAUSE_WITHIN_NS) >= trouble;
    foreseen.filter(explains).min().unwrap_or(trouble)
}

/// When the consumer of a connection had a sample of `epoch`: its agent says so at once, and its
/// counters say so later; the earlier of both.
fn heard_ns(run: &Run, name: &str, link: &Link, epoch: u64) -> Option<u64> {
    let said = run
        .events_of("heard")
        .filter(|event| event.epoch >= epoch && run.name(&event.system, &event.reason) == name);
    said.map(|event| event.monotonic_ns).chain(link.heard_ns(epoch)).min()
}

/// The longest pause of a stream of moments that overlaps a window, and the median of all before it.
fn command_pause(times: &[u64], from: u64, until: u64) -> Option<Pause> {
    let pauses = |keep: &dyn Fn(u64, u64) -> bool| -> Vec<u64> {
        let pairs = times.windows(2).filter(|pair| keep(pair[0], pair[1]));
        let mut pauses: Vec<u64> = pairs.map(|pair| pair[1].saturating_sub(pair[0])).collect();
        pauses.sort_unstable();
        pauses
    };
    let around = pauses(&|before, after| after >= from && before <= until);
    let earlier = pauses(&|_, after| after < from);
    let mut longest = *around.last()?;
    // Commands that stopped for good make a pause without an end.
    if let Some(last) = times.last().filter(|last| **last <= until) {
        longest = longest.max(until - last);
    }
    let typical = if earlier.is_empty() { &around } else { &earlier };
    Some(Pause { gap_max_ns: longest, period_median_ns: typical.get(typical.len() / 2).copied() })
}

/// Mean and largest distance between each estimate and the truth at its moment.
fn position_error(fixes: &[Fix], extra: &Extra) -> Option<(f64, f64)> {
    let topic = extra.position_topic.as_deref()?;
    let until = extra.until_ns.unwrap_or(u64::MAX);
    let (mut sum, mut count, mut worst) = (0.0, 0.0, 0.0_f64);
    for fix in fixes.iter().filter(|fix| fix.topic == topic && fix.monotonic_ns <= until) {
        let Some((x, y)) = truth_at(&extra.truth, fix.monotonic_ns) else { continue };
        let error = (fix.x_m - x).hypot(fix.y_m - y);
        // An estimator that does not know yet where it is says so by NaN.
        if !error.is_finite() {
            continue;
        }
        sum += error;
        count += 1.0;
        worst = worst.max(error);
    }
    (count > 0.0).then(|| (sum / count, worst))
}

/// The truth between its two nearest moments.
fn truth_at(truth: &[TruthPoint], at_ns: u64) -> Option<(f64, f64)> {
    let after = truth.partition_point(|point| point.monotonic_ns < at_ns);
    let (b, a) = (truth.get(after)?, truth.get(after.checked_sub(1)?)?);
    let span = b.monotonic_ns.checked_sub(a.monotonic_ns)?;
    if span == 0 || span > TRUTH_WITHIN_NS {
        return None;
    }
    let share = super::run::seconds(at_ns - a.monotonic_ns) / super::run::seconds(span);
    Some((a.x_m + share * (b.x_m - a.x_m), a.y_m + share * (b.y_m - a.y_m)))
}

#[expect(
    clippy::cast_possible_truncation,
    clippy::cast_sign_loss,
    reason = "`as` holds what is negative or too large at the ends of u64"
)]
fn whole(value: f64) -> u64 {
    value as u64
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_commands_pause_is_found_and_one_without_end_counts() {
        let times: Vec<u64> = vec![0, 20, 40, 60, 200, 220, 240];
        let pause = command_pause(&times, 50, 230).unwrap();
        assert_eq!((pause.gap_max_ns, pause.period_median_ns), (140, Some(20)));
        assert_eq!(command_pause(&times, 50, 900).unwrap().gap_max_ns, 660);
        assert_eq!(command_pause(&[5], 0, 10), None);
    }

    #[test]
    fn samples_add_up_whichever_counter_was_read_last() {
        let counts = Counts { received: 368, lost: 2, ..Counts::default() };
        for sent in [0, 367, 370, 379] {
            let traffic = Traffic::new(Some(sent), counts);
            assert_eq!(traffic.sent, Some(370 + traffic.unheard.unwrap()));
        }
        assert_eq!(Traffic::new(Some(379), counts).unheard, Some(9));
        assert_eq!(Traffic::new(None, counts).unheard, None);
    }

    #[test]
    fn an_estimate_that_knows_nothing_yet_is_no_error() {
        let point = |ms: u64| TruthPoint { monotonic_ns: ms * 1_000_000, x_m: 1.0, y_m: 0.0 };
        let fix = |ms: u64, x_m| Fix {
            monotonic_ns: ms * 1_000_000,
            topic: "/p".to_owned(),
            x_m,
            y_m: 0.0,
        };
        let extra = Extra {
            position_topic: Some("/p".to_owned()),
            truth: vec![point(0), point(50)],
            ..Extra::default()
        };
        let fixes = [fix(10, f64::NAN), fix(20, 1.5), fix(30, 1.1)];
        let (mean, worst) = position_error(&fixes, &extra).unwrap();
        assert!((mean - 0.3).abs() < 1e-9 && (worst - 0.5).abs() < 1e-9);
        assert_eq!(position_error(&fixes[..1], &extra), None);
    }

    #[test]
    fn truth_is_interpolated_and_never_guessed() {
        let point = |ms: u64, x_m| TruthPoint { monotonic_ns: ms * 1_000_000, x_m, y_m: 0.0 };
        let truth = [point(0, 0.0), point(50, 1.0), point(900, 2.0)];
        assert_eq!(truth_at(&truth, 25_000_000), Some((0.5, 0.0)));
        assert_eq!(truth_at(&truth, 500_000_000), None);
        assert_eq!(truth_at(&truth, 950_000_000), None);
    }
}
