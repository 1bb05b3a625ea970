//! Plain runs, for figures: steady loss, regular outages, markers, kills; nothing drawn.
//!
//! ```text
//! start, deploy, converge | idle: bytes | markers: known99 | kills: detection, gap, joins
//! ```

use std::time::Duration;

use sdr_core::{
    fitness::RolePolicy, mesh::SECTION_NAMES, record::RecordKind, spec::SystemSpec, time::Instant,
};

use super::{
    Chance, Fault, Fleet, Incident, Record, Setup, Weather, fault::DiskFate, fleet::BEGIN,
    measure::Measure, run::Run, systems,
};

/// Components of one system.
const SYSTEM_COMPONENTS: usize = 10;
/// A fleet that takes longer to come up is told as a violation.
const CONVERGED_MAX: Duration = Duration::from_secs(120);
/// Every fifth robot is deaf once in each of these.
const OUTAGE_PERIOD: Duration = Duration::from_secs(60);
/// Robots of which one is deaf.
const OUTAGE_SHARE: usize = 5;
/// How long a killed robot stays away.
const DOWN: Duration = Duration::from_secs(40);
/// From its return to the next kill.
const BETWEEN_KILLS: Duration = Duration::from_secs(20);
/// After a kill it is looked so often who is quiet.
const QUIET_LOOKS: Duration = Duration::from_millis(50);
/// In a hand-over it is looked so often who acts as coordinator ...
const HAND_OVER_LOOKS: Duration = Duration::from_millis(1);
/// ... for so long at most.
const HANDED_OVER_MAX: Duration = Duration::from_secs(8);
/// Markers measured in one run.
const MARKERS: usize = 8;
/// Time until the next marker.
const BETWEEN_MARKERS: Duration = Duration::from_secs(4);

/// What `sdr sim run` is asked for.
#[derive(Debug, Clone, PartialEq)]
pub struct Plain {
    /// Robots.
    pub robots: usize,
    /// Components, in systems of ten.
    pub components: usize,
    /// Virtual time in all.
    pub time: Duration,
    /// Share of datagrams lost, each for itself.
    pub loss: f64,
    /// How long every fifth robot is deaf in each minute.
    pub outage: Duration,
    /// Agents' loops stand still for so long, each once in 5 minutes.
    pub stall: Duration,
    /// Whether robots are killed in the last part.
    pub kills: bool,
    /// Whether all know each other and everything runs when time begins.
    pub converged: bool,
    /// Draws who is killed and what is lost.
    pub seed: u64,
}

impl Plain {
    /// Runs it.
    pub fn run(&self) -> Record {
        let mut chance = Chance::stream(self.seed, 3);
        let mut fleet = self.fleet();
        let lacking = match self.converged {
            true => fleet.start_converged(&self.systems(fleet.setup())).err(),
            false => None,
        };
        let mut run = Run::new(fleet, self.seed);
        let begin = run.fleet.now;
        let end = begin + self.time;
        match lacking {
            Some(what) => run.note("not-converged", what),
            None if self.converged => {}
            None => self.come_up(&mut run, &mut chance),
        }
        self.schedule_outages(&mut run.fleet, end);
        let left = end.since(run.fleet.now);
        let idle = if self.kills { left.mul_f64(0.4) } else { left.mul_f64(0.8) };
        idle_bytes(&mut run, idle);
        markers(&mut run, &mut chance, left.mul_f64(0.15));
        if self.kills {
            kills(&mut run, &mut chance, end);
        }
        let rest = end.since(run.fleet.now);
        run.advance(rest);
        run.finish()
    }

    fn fleet(&self) -> Fleet {
        let mut setup = Setup::new(self.robots, self.seed);
        setup.weather = Weather { loss: self.loss, ..Weather::fair() };
        setup.drift_ppm_max = 50;
        let mut fleet = Fleet::new(setup);
        for robot in 0..self.robots {
            fleet.keep_disk(robot, self.kills && self.robots <= 200);
        }
        fleet
    }

    /// All robots start within half a second; systems follow; done when everything runs.
    fn come_up(&self, run: &mut Run, chance: &mut Chance) {
        for robot in 0..self.robots {
            run.fleet.switch_on(robot);
            run.advance(Duration::from_millis(500) / u32::try_from(self.robots).unwrap_or(1));
        }
        let pace = Duration::from_millis(200);
        let led = |fleet: &Fleet| {
            let all: Vec<usize> = (0..fleet.robots.len()).collect();
            super::check::convergence::one_coordinator(fleet, &all).is_none()
        };
        let mut converged = run.advance_until(CONVERGED_MAX, pace, led);
        for system in self.systems(run.fleet.setup()) {
            run.fleet.deploy(chance.below(self.robots), &system);
            run.advance(Duration::from_millis(20));
        }
        converged &=
            run.advance_until(CONVERGED_MAX, pace, |fleet| Measure::lacking(fleet).is_none());
        if converged {
            run.measure.record.converged_ms.push(run.fleet.age().as_secs_f64() * 1000.0);
        } else {
            let what = Measure::lacking(&run.fleet).unwrap_or_else(|| "late".into());
            run.note("not-converged", what);
        }
    }

    /// All components in systems of ten.
    fn systems(&self, setup: &Setup) -> Vec<SystemSpec> {
        let needs = systems::fitting(self.robots, self.components, setup.memory, setup.cpu);
        let recovery = systems::patient();
        let system = |first: usize| {
            let count = (self.components - first).min(SYSTEM_COMPONENTS);
            let name = systems::name("system", first / SYSTEM_COMPONENTS);
            let chain = systems::chain(name, count, needs);
            SystemSpec { recovery: recovery.clone(), ..chain }
        };
        (0..self.components).step_by(SYSTEM_COMPONENTS).map(system).collect()
    }

    fn schedule_outages(&self, fleet: &mut Fleet, end: Instant) {
        let groups = self.robots.div_ceil(OUTAGE_SHARE).max(1);
        let regular =
            [(self.outage, OUTAGE_PERIOD, OUTAGE_SHARE), (self.stall, OUTAGE_PERIOD * 5, 1)];
        for (time, period, share) in regular {
            if time.is_zero() {
                continue;
            }
            for (turn, robot) in (0..self.robots).step_by(share).enumerate() {
                let spread = period.mul_f64(turn as f64 / groups.max(1) as f64 % 1.0);
                let mut at = fleet.now + spread;
                while at < end {
                    let fault = match share {
                        1 => Fault::Pause { robot, time, clock: super::ClockFate::Runs },
                        _ => Fault::Deaf { robot, time },
                    };
                    fleet.schedule(&Incident { after: at.since(BEGIN), fault });
                    at = at + period;
                }
            }
        }
    }
}

/// Nothing happens; what is sent is counted.
fn idle_bytes(run: &mut Run, time: Duration) {
    let guards = |fleet: &Fleet| -> Vec<u64> {
        fleet.robots.iter().map(super::Robot::guard_bytes).collect()
    };
    let before = (run.fleet.tally.sent_bytes.clone(), guards(&run.fleet));
    let sections_before = sections(&run.fleet);
    run.advance(time);
    let seconds = time.as_secs_f64().max(0.001);
    let after = (run.fleet.tally.sent_bytes.clone(), guards(&run.fleet));
    for robot in 0..run.fleet.robots.len() {
        let guard = after.1[robot].saturating_sub(before.1[robot]);
        let all = after.0[robot] - before.0[robot];
        run.measure.record.bytes_per_robot_s.push(all.saturating_sub(guard) as f64 / seconds);
        run.measure.record.guard_bytes_per_robot_s.push(guard as f64 / seconds);
    }
    let robot_seconds = seconds * run.fleet.robots.len() as f64;
    let sums = sections(&run.fleet).into_iter().zip(sections_before);
    for (name, (after, before)) in SECTION_NAMES.iter().zip(sums) {
        let rate = after.saturating_sub(before) as f64 / robot_seconds;
        run.measure.record.section_bytes_per_robot_s.entry(name).or_default().push(rate);
    }
}

/// Bytes of the whole fleet by section.
fn sections(fleet: &Fleet) -> [u64; SECTION_NAMES.len()] {
    let mut all = [0; SECTION_NAMES.len()];
    for robot in &fleet.robots {
        all.iter_mut().zip(robot.section_bytes()).for_each(|(sum, bytes)| *sum += bytes);
    }
    all
}

/// Small systems deployed anywhere; how long until 99 % of the robots hold each.
fn markers(run: &mut Run, chance: &mut Chance, time: Duration) {
    let end = run.fleet.now + time;
    for number in 0..MARKERS {
        if run.fleet.now + BETWEEN_MARKERS > end {
            return;
        }
        let needs =
            systems::fitting(1000, 1, run.fleet.setup().memory, sdr_core::units::Permille(1));
        let system = systems::chain(systems::name("marker", number), 1, needs);
        let begun = run.fleet.now;
        let mut receiver = chance.below(run.fleet.robots.len());
        for _ in 0..run.fleet.robots.len() {
            if !run.fleet.was_deaf_since(receiver, begun) {
                break;
            }
            receiver = (receiver + 1) % run.fleet.robots.len();
        }
        run.fleet.deploy(receiver, &system);
        let mut lacking: Vec<usize> = (0..run.fleet.robots.len()).collect();
        let known = run.advance_until(BETWEEN_MARKERS, Duration::from_millis(5), |fleet| {
            lacking.retain(|robot| {
                let table = fleet.table(*robot);
                // who hears nothing can know nothing
                let deaf = fleet.was_deaf_since(*robot, begun);
                !deaf
                    && table
                        .is_some_and(|t| t.get(RecordKind::SYSTEM, system.name.as_str()).is_none())
            });
            lacking.len() * 100 <= fleet.robots.len()
        });
        let took = run.fleet.now.since(begun);
        // a receiver that fell deaf told nobody
        if !run.fleet.was_deaf_since(receiver, begun) {
            run.measure.record.known99_ms.push(took.as_secs_f64() * 1000.0);
        }
        if known {
            run.advance(BETWEEN_MARKERS.saturating_sub(took));
        }
        run.fleet.undeploy(receiver, &system.name);
    }
}

/// One robot after the other loses power; every third is the coordinator; every other comes
/// back with an empty disk.
fn kills(run: &mut Run, chance: &mut Chance, end: Instant) {
    let mut number = 0;
    while run.fleet.robots.len() > 1 && run.fleet.now + DOWN + BETWEEN_KILLS <= end {
        let holder = run.fleet.highest_coordinator().filter(|_| number % 3 == 0);
        let robot = holder.unwrap_or_else(|| chance.below(run.fleet.robots.len()));
        run.measure.kill(&run.fleet, robot);
        let lost = number % 2 == 1;
        let disk = if lost { DiskFate::Lost } else { DiskFate::Kept };
        run.fleet.strike(&Fault::Crash { robot, down: None, disk });
        let watched = run.fleet.gone_after();
        see_it_fall_quiet(run, watched);
        run.advance(DOWN.saturating_sub(watched));
        run.measure.revive(robot);
        if lost {
            run.measure.join(&run.fleet, robot);
        }
        run.fleet.switch_on(robot);
        run.advance(BETWEEN_KILLS / 2);
        hand_over(run, BETWEEN_KILLS / 2);
        number += 1;
    }
}

/// A policy forbids the role to its holder, which hands it over; it is looked often who acts.
fn hand_over(run: &mut Run, time: Duration) {
    let end = run.fleet.now + time;
    let holder = run.fleet.highest_coordinator().filter(|robot| run.fleet.can_speak(*robot));
    let term = |fleet: &Fleet, robot: usize| fleet.robots[robot].coordinator().map(|role| role.1);
    if let Some(holder) = holder {
        let before = term(&run.fleet, holder);
        let forbidden = vec![run.fleet.robots[holder].id.clone()];
        let policy = RolePolicy { forbidden, ..RolePolicy::default() };
        run.fleet.set_role_policy(holder, &policy);
        let (mut gap, mut overlap) = (Duration::ZERO, Duration::ZERO);
        let over = run.advance_until(HANDED_OVER_MAX, HAND_OVER_LOOKS, |fleet| {
            let acting = fleet.robots.iter().filter(|robot| robot.coordinates()).count();
            match acting {
                0 => gap += HAND_OVER_LOOKS,
                1 => {}
                _ => overlap += HAND_OVER_LOOKS,
            }
            // until the old holder knows the new one
            acting == 1 && term(fleet, holder) > before
        });
        if over {
            run.measure.record.handover_gap_ms.push(gap.as_secs_f64() * 1000.0);
            run.measure.record.handover_overlap_ms.push(overlap.as_secs_f64() * 1000.0);
        }
    }
    run.advance(end.since(run.fleet.now));
}

/// Lets time pass after a kill, and looks often: quiet is no event.
fn see_it_fall_quiet(run: &mut Run, time: Duration) {
    let end = run.fleet.now + time;
    while run.fleet.now < end {
        run.advance(QUIET_LOOKS.min(end.since(run.fleet.now)));
        run.measure.look_at_quiet(&run.fleet);
    }
}
