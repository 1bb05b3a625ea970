//! Measures what the figures are made of, by watching.

use sdr_core::{
    brain::Brain,
    event::Event,
    id::RobotId,
    mesh::Standing,
    record::RecordKind,
    time::{Duration, Instant},
};

use super::{Fleet, Record, Sight, check::convergence, same_table};

/// A coordinator that nothing but chance silenced for so long was taken over falsely.
const LATELY: Duration = Duration::from_secs(5);

/// A robot that was killed on purpose.
#[derive(Debug)]
struct Kill {
    robot: usize,
    at: Instant,
    gone: Vec<bool>,
    quiet: Vec<bool>,
}

/// A robot that starts with an empty disk.
#[derive(Debug)]
struct Join {
    robot: usize,
    bytes_before: u64,
}

/// Watches one run.
#[derive(Debug, Default)]
pub(crate) struct Measure {
    pub(crate) record: Record,
    kills: Vec<Kill>,
    /// When the coordinator was killed, and its term.
    beheaded: Option<(Instant, u64)>,
    join: Option<Join>,
    /// Where each component was at home: component, epoch number, home.
    homes: std::collections::BTreeMap<String, (sdr_core::order::Epoch, RobotId)>,
    troubled: std::collections::BTreeMap<usize, Instant>,
}

impl Measure {
    /// `robot` is about to lose power.
    pub(crate) fn kill(&mut self, fleet: &Fleet, robot: usize) {
        let watches = |observer: usize| {
            observer != robot
                && fleet.robots[observer].is_on()
                && fleet.apart_for(observer, robot).is_none()
        };
        // a robot that does not watch has nothing to say
        let blind: Vec<bool> = (0..fleet.robots.len()).map(|observer| !watches(observer)).collect();
        self.kills.push(Kill { robot, at: fleet.now, gone: blind.clone(), quiet: blind });
        if fleet.highest_coordinator() == Some(robot) {
            let term = fleet.robots[robot].coordinator().map_or(0, |(_, term)| term);
            self.beheaded = Some((fleet.now, term));
        }
    }

    /// A killed robot comes back: who has not noticed by now never will.
    pub(crate) fn revive(&mut self, robot: usize) {
        self.kills.retain(|kill| kill.robot != robot);
    }

    /// `robot` starts with an empty disk.
    pub(crate) fn join(&mut self, fleet: &Fleet, robot: usize) {
        self.join = Some(Join { robot, bytes_before: bytes_of(fleet, robot) });
    }

    pub(crate) fn see(&mut self, fleet: &Fleet, sight: &Sight) {
        if let Sight::Told { robot, event } = sight {
            self.told(fleet, *robot, event);
        }
        if matches!(sight, Sight::Look) {
            self.look(fleet);
        }
    }

    fn told(&mut self, fleet: &Fleet, observer: usize, event: &Event) {
        match event.kind.as_str() {
            "robot-gone" => self.judged_gone(fleet, observer, event),
            "role-taken" => {
                let holder = named(fleet, observer, event);
                let silent = event.reason.contains("is silent for");
                let was_false = |holder| silent && spoke_lately(fleet, observer, holder);
                let is_false = holder.is_some_and(was_false);
                self.record.false_takeovers += u64::from(is_false);
                let suspect = event.numbers.get("suspect_ms").filter(|_| !is_false);
                self.record.takeover_ms.extend(suspect);
            }
            "condition-raised" | "hung" | "exited" | "error" | "held" => {
                self.troubled.insert(observer, fleet.now);
            }
            _ => {}
        }
        if let Some((at, term)) = self.beheaded
            && fleet.robots[observer].coordinator().is_some_and(|(_, now)| now > term)
            && fleet.robots[observer].is_coordinator()
        {
            self.record.coordinator_gap_ms.push(ms(fleet.now.since(at)));
            self.beheaded = None;
        }
    }

    fn judged_gone(&mut self, fleet: &Fleet, observer: usize, event: &Event) {
        let Some(target) = named(fleet, observer, event) else { return };
        if let Some(kill) = self.kills.iter_mut().find(|kill| kill.robot == target) {
            if !std::mem::replace(&mut kill.gone[observer], true) {
                self.record.detection_ms.push(ms(fleet.now.since(kill.at)));
            }
        } else if is_false(fleet, observer, target) {
            self.record.false_deaths += 1;
        }
    }

    /// Quiet is no event, since it is usual on a lossy link: it is read from the meshes.
    pub(crate) fn look_at_quiet(&mut self, fleet: &Fleet) {
        for kill in &mut self.kills {
            let target = &fleet.robots[kill.robot].id;
            for (observer, noted) in kill.quiet.iter_mut().enumerate().filter(|(_, noted)| !**noted)
            {
                let mesh = fleet.robots[observer].brain().map(Brain::mesh);
                if mesh.is_some_and(|mesh| mesh.standing(target) != Standing::Alive) {
                    *noted = true;
                    self.record.quiet_ms.push(ms(fleet.now.since(kill.at)));
                }
            }
        }
    }

    fn look(&mut self, fleet: &Fleet) {
        self.look_at_quiet(fleet);
        self.look_at_join(fleet);
        self.look_at_homes(fleet);
    }

    fn look_at_join(&mut self, fleet: &Fleet) {
        let Some(join) = &self.join else { return };
        let (Some(own), Some(holder)) = (fleet.table(join.robot), fleet.highest_coordinator())
        else {
            return;
        };
        let Some(table) = fleet.table(holder).filter(|_| holder != join.robot) else { return };
        if table.root() == own.root() && same_table(table, own) {
            let bytes = bytes_of(fleet, join.robot) - join.bytes_before;
            self.record.join_bytes.push(bytes as f64);
            self.join = None;
        }
    }

    /// Moves: a home under a new epoch on another robot, as the coordinator's table has it.
    fn look_at_homes(&mut self, fleet: &Fleet) {
        let Some(holder) = fleet.highest_coordinator() else { return };
        let Some(table) = fleet.table(holder) else { return };
        for (key, version, value) in table.of_kind(RecordKind::ASSIGNMENT) {
            let (Some(epoch), sdr_core::record::FleetValue::Assignment(now)) =
                (&version.epoch, value)
            else {
                continue;
            };
            let known = self.homes.get(&key.name);
            if known.is_some_and(|(before, _)| before >= epoch) {
                continue;
            }
            let before = self.homes.insert(key.name.clone(), (epoch.clone(), now.home.clone()));
            let Some((_, from)) = before.filter(|(_, from)| *from != now.home) else { continue };
            self.record.moves += 1;
            if fleet.robot_number(&from).is_some_and(|from| self.was_well(fleet, from)) {
                self.record.needless_moves += 1;
            }
        }
    }

    /// Whether a robot has been up, reachable and without trouble for a while.
    fn was_well(&self, fleet: &Fleet, robot: usize) -> bool {
        let up = fleet.robots[robot].is_on()
            && fleet.now.since(fleet.robots[robot].on_since()) >= fleet.gone_after();
        let apart = (0..fleet.robots.len()).filter_map(|other| fleet.apart_for(robot, other)).max();
        let troubled = self
            .troubled
            .get(&robot)
            .is_some_and(|at| fleet.now.since(*at) < fleet.gone_after() * 6);
        up && apart.is_none_or(|apart| apart < fleet.gone_after()) && !troubled
    }

    /// Whether everything runs as it should; why not.
    pub(crate) fn lacking(fleet: &Fleet) -> Option<String> {
        convergence::lacking(fleet)
    }
}

/// The other robot that an event is about.
fn named(fleet: &Fleet, observer: usize, event: &Event) -> Option<usize> {
    let words = event.reason.split(|c: char| !(c.is_alphanumeric() || c == '-'));
    let named = words.filter_map(|word| RobotId::new(word).ok());
    named.filter_map(|id| fleet.robot_number(&id)).find(|robot| *robot != observer)
}

/// Whether a robot has been up, and nothing but chance kept the two from hearing each other,
/// for a while.
fn spoke_lately(fleet: &Fleet, observer: usize, holder: usize) -> bool {
    let robot = &fleet.robots[holder];
    let since = fleet.now - LATELY;
    let heard =
        |robot: usize| !fleet.was_deaf_since(robot, since) && !fleet.was_paused_since(robot, since);
    robot.is_on()
        && robot.on_since() <= since
        && heard(holder)
        && heard(observer)
        && fleet.apart_for(observer, holder).is_none()
}

/// Whether a judgement "gone" was wrong: the robot was up for at least as long as silence must
/// last, and whatever kept the two apart (deafness, a cut, an agent that stands still), if
/// anything did, is shorter than that from its beginning to its end.
fn is_false(fleet: &Fleet, observer: usize, target: usize) -> bool {
    let robot = &fleet.robots[target];
    let up = robot.is_on() && fleet.now.since(robot.on_since()) >= fleet.gone_after();
    up && fleet.apart_for(observer, target).is_none_or(|apart| apart < fleet.gone_after())
}

fn bytes_of(fleet: &Fleet, robot: usize) -> u64 {
    fleet.tally.sent_bytes[robot] + fleet.tally.received_bytes[robot]
}

fn ms(time: Duration) -> f64 {
    time.as_secs_f64() * 1000.0
}
