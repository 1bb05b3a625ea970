//! What this robot says of itself, and how often.

use alloc::{
    collections::{BTreeMap, BTreeSet},
    string::String,
    vec::Vec,
};

use super::{Brain, judge::Calls};
use crate::{
    allocate::Homeless,
    id::{ComponentKey, NAME_BYTES_MAX, RobotId},
    input::InstanceId,
    mesh::{AuthorKey, Push},
    report::{HostReport, InstanceReport, LinkReport, Report, Usage},
    time::{Duration, Instant},
    units::{Bytes, Permille},
};

/// Host figures are said again at the latest so long after the last time ...
const HOST_PERIOD: Duration = Duration::from_secs(10);
/// ... and figures of components at most so often.
const USAGE_PERIOD: Duration = Duration::from_secs(1);
/// Links are looked at so often.
const LINK_PERIOD: Duration = Duration::from_secs(2);
/// A change of memory that is said at once.
const MEMORY_STEP: Bytes = Bytes(8_000_000);
/// A change of CPU that is said at once, thousandths of a core.
const CPU_STEP: u32 = 100;
/// A change of a component's memory that is said within a second.
const USAGE_MEMORY_STEP: Bytes = Bytes(2_000_000);
/// A change of a component's CPU that is said within a second, thousandths of a core.
const USAGE_CPU_STEP: u32 = 20;
/// A change of the radio that is said at once, tenths of a dBm.
const RSSI_STEP: u16 = 10;

/// Links said, beside those that components here use: a sample that the fleet shares, so
/// that what all robots say of their links stays the same however many they are.
const LINKS_SAID: usize = 8;
const LINKS_SAID_MIN: usize = 4;
const LINKS_SAID_BY_ALL: usize = 480;
/// Of those, links are said once they are measured so well, thousandths of loss.
const LINK_NOISE_MAX: Permille = Permille(200);
/// A change of a round trip that is said, as a share of it, when it is more than a few ms.
const RTT_SHARE: u32 = 4;
/// Changes of round trips and jitter below this are noise.
const RTT_STEP: Duration = Duration::from_millis(5);
/// A change of loss that is said, thousandths, when chance does not explain it ...
const LOSS_STEP: u32 = 80;
/// ... by so many standard deviations of what was counted.
const LOSS_DEVIATIONS: u32 = 3;

/// Refusals of one component that others hear of; all of them stand in the event.
const REFUSALS_TOLD: usize = 8;

/// What was said last, and what is worth saying again.
#[derive(Clone, Debug, Default)]
pub(super) struct Said {
    host: Option<(Instant, HostReport)>,
    links_at: Option<Instant>,
    links: BTreeMap<RobotId, LinkReport>,
    instances: BTreeMap<ComponentKey, (Instant, InstanceReport)>,
    restarts: BTreeMap<ComponentKey, u16>,
    calls: Calls,
}

impl Said {
    pub(super) fn count_restart(&mut self, key: &ComponentKey) {
        let count = self.restarts.entry(key.clone()).or_default();
        *count = count.saturating_add(1);
    }

    /// A component begins anew, or left.
    pub(super) fn forget_restarts(&mut self, key: &ComponentKey) {
        self.restarts.remove(key);
    }

    pub(super) fn restarts_of(&self, key: &ComponentKey) -> u16 {
        self.restarts.get(key).copied().unwrap_or(0)
    }

    pub(super) fn note_condition(&mut self, key: &ComponentKey, reason: &str, now: Instant) {
        self.calls.insert(key.clone(), (now, reason.into()));
    }

    /// Calls that waited for `wait`; each is given once.
    pub(super) fn unanswered(&mut self, now: Instant, wait: Duration) -> Vec<ComponentKey> {
        let late: Vec<ComponentKey> = self
            .calls
            .iter()
            .filter(|(_, (since, _))| now.since(*since) >= wait)
            .map(|(key, _)| key.clone())
            .collect();
        for key in &late {
            self.calls.remove(key);
        }
        late
    }
}

impl Brain {
    pub(super) fn say_facts(&mut self) {
        let facts = self.config.facts.clone();
        self.mesh.report(&Report::Facts(facts), Push::Now);
    }

    pub(super) fn say(&mut self, now: Instant) {
        if core::mem::take(&mut self.usage_due) {
            self.say_instances(now);
        }
        self.say_host(now);
        self.say_links(now);
        self.say_stored();
    }

    fn say_host(&mut self, now: Instant) {
        let Some(host) = self.host else { return };
        let due = match &self.said.host {
            None => true,
            Some((at, before)) => now.since(*at) >= HOST_PERIOD || differs(before, &host),
        };
        if due {
            self.said.host = Some((now, host));
            self.mesh.report(&Report::Host(host), Push::WithGossip);
        }
    }

    /// Links that matter here, when they changed enough.
    fn say_links(&mut self, now: Instant) {
        if self.said.links_at.is_some_and(|at| now.since(at) < LINK_PERIOD) {
            return;
        }
        self.said.links_at = Some(now);
        let links = self.links_that_matter();
        let silent: Vec<RobotId> =
            self.said.links.keys().filter(|robot| !links.contains_key(*robot)).cloned().collect();
        for robot in silent {
            self.said.links.remove(&robot);
            self.mesh.retract(&AuthorKey::link(&robot));
        }
        for (robot, link) in links {
            let noise = self.mesh.link_noise(&robot);
            let before = self.said.links.get(&robot);
            if before.is_none_or(|before| link_differs(before, &link, noise)) {
                self.said.links.insert(robot.clone(), link);
                self.mesh.report(&Report::Link(robot, link), Push::WithGossip);
            }
        }
    }

    /// Links to the homes that components here talk with, and some others, so that a report
    /// does not grow with the fleet.
    fn links_that_matter(&self) -> BTreeMap<RobotId, LinkReport> {
        let mut matter: BTreeSet<RobotId> = BTreeSet::new();
        for key in self.index.at(&self.me) {
            matter.extend(self.partners(key));
        }
        let fleet = self.mesh.authors().robots().count();
        let sampled = fleet > LINKS_SAID + 1;
        if !sampled {
            matter.extend(self.role().map(|role| role.holder.clone()));
        }
        let mut links: BTreeMap<RobotId, LinkReport> = BTreeMap::new();
        let mut others = Vec::new();
        let measured = |robot: &RobotId| Some((robot.clone(), self.mesh.link(robot)?));
        for robot in self.mesh.linked() {
            if matter.contains(robot) {
                links.extend(measured(robot));
            } else {
                // those said before stay; others on every robot
                let before = self.said.links.contains_key(robot);
                let measured = !sampled || self.mesh.link_noise(robot) <= LINK_NOISE_MAX;
                if before || measured {
                    let mut names = [0; 2 * NAME_BYTES_MAX];
                    let names = joined(&mut names, [self.me.as_str(), robot.as_str()]);
                    others.push(((!before, crate::order::hash64(names)), robot));
                }
            }
        }
        let share = LINKS_SAID_BY_ALL / fleet.max(1);
        let room = share.clamp(LINKS_SAID_MIN, LINKS_SAID).saturating_sub(links.len());
        if others.len() > room {
            others.select_nth_unstable(room);
        }
        links.extend(others.into_iter().take(room).filter_map(|(_, robot)| measured(robot)));
        links
    }

    /// States and tokens at once, figures when they changed enough.
    pub(super) fn say_instances(&mut self, now: Instant) {
        let mut spoken: BTreeSet<ComponentKey> = BTreeSet::new();
        let ids: Vec<InstanceId> = self.instances.keys().copied().collect();
        for id in ids {
            let report = self.own_report(id);
            let key = report.component.clone();
            // one report a component: of the instance that acts, else of one that may
            if self.current(&key).is_some_and(|current| current != id) {
                continue;
            }
            spoken.insert(key.clone());
            let push = match self.said.instances.get(&key) {
                None => Push::Now,
                Some((_, before)) if !same_but_usage(before, &report) => Push::Now,
                Some((at, before)) => {
                    let due = now.since(*at) >= USAGE_PERIOD;
                    if !due || !usage_differs(before.usage, report.usage) {
                        continue;
                    }
                    Push::WithGossip
                }
            };
            self.said.instances.insert(key, (now, report.clone()));
            self.mesh.report(&Report::Instance(report), push);
        }
        let silent: Vec<ComponentKey> =
            self.said.instances.keys().filter(|key| !spoken.contains(key)).cloned().collect();
        for key in silent {
            self.said.instances.remove(&key);
            self.mesh.retract(&AuthorKey::instance(&key));
        }
    }

    /// Says as coordinator why a component has no home; false when that was known.
    pub(super) fn say_homeless(&mut self, homeless: &Homeless) -> bool {
        let refusals = homeless.refusals.clone();
        let known = self.plans.refusals.insert(homeless.component.clone(), refusals);
        if known.as_ref() == Some(&homeless.refusals) {
            return false;
        }
        let mut short = homeless.clone();
        short.refusals.truncate(REFUSALS_TOLD);
        self.mesh.report(&Report::Homeless(short), Push::Now);
        true
    }

    /// A component has a home, or is not wanted any more.
    pub(super) fn unsay_homeless(&mut self, key: &ComponentKey) {
        if self.plans.refusals.remove(key).is_some() {
            self.mesh.retract(&AuthorKey::homeless(key));
        }
    }

    /// Takes back what was said of components that nobody wants any more.
    pub(super) fn unsay_unwanted(&mut self) {
        let gone = |key: &&ComponentKey| {
            let system = self.systems.get(&key.system);
            system.and_then(|system| system.component(&key.name)).is_none()
        };
        let gone: Vec<ComponentKey> = self.plans.refusals.keys().filter(gone).cloned().collect();
        gone.iter().for_each(|key| self.unsay_homeless(key));
    }

    /// The report of an instance here, as it is now.
    pub(super) fn own_report(&self, id: InstanceId) -> InstanceReport {
        let instance = &self.instances[&id];
        InstanceReport {
            component: instance.component.clone(),
            state: instance.state,
            token: instance.token.clone(),
            ready: instance.ready,
            usage: instance.usage,
            heard: instance.heard.iter().map(|(index, token)| (*index, token.clone())).collect(),
            restarts: self.said.restarts_of(&instance.component),
            spare_ready: self.spare_is_ready(&instance.component),
        }
    }

    /// Why a component called for help here.
    pub(super) fn call_of(&self, key: &ComponentKey) -> Option<String> {
        self.said.calls.get(key).map(|(_, reason)| reason.clone())
    }
}

fn same_but_usage(before: &InstanceReport, now: &InstanceReport) -> bool {
    InstanceReport { usage: now.usage, ..before.clone() } == *now
}

/// Two words one behind the other.
fn joined<'a>(bytes: &'a mut [u8; 2 * NAME_BYTES_MAX], words: [&str; 2]) -> &'a [u8] {
    let mut used = 0;
    for word in words {
        bytes[used..used + word.len()].copy_from_slice(word.as_bytes());
        used += word.len();
    }
    &bytes[..used]
}

/// Whether figures of a component are worth saying again.
fn usage_differs(before: Usage, now: Usage) -> bool {
    before.memory.0.abs_diff(now.memory.0) >= USAGE_MEMORY_STEP.0
        || before.cpu.0.abs_diff(now.cpu.0) >= USAGE_CPU_STEP
}

fn differs(before: &HostReport, now: &HostReport) -> bool {
    let radio = match (before.rssi, now.rssi) {
        (Some(before), Some(now)) => before.tenths().abs_diff(now.tenths()) >= RSSI_STEP,
        (None, None) => false,
        (Some(_), None) | (None, Some(_)) => true,
    };
    let battery = |host: &HostReport| host.battery.unwrap_or(Permille(0)).0 / 10;
    before.memory_used.0.abs_diff(now.memory_used.0) >= MEMORY_STEP.0
        || before.cpu_used.0.abs_diff(now.cpu_used.0) >= CPU_STEP
        || radio
        || battery(before) != battery(now)
}

/// Whether a link is worth saying again.
fn link_differs(before: &LinkReport, now: &LinkReport, noise: Permille) -> bool {
    let time =
        |before: Duration, now: Duration| before.abs_diff(now) >= RTT_STEP.max(before / RTT_SHARE);
    let step = LOSS_STEP.max(noise.0 * LOSS_DEVIATIONS);
    let share = |before: Permille, now: Permille| before.0.abs_diff(now.0) >= step;
    time(before.rtt, now.rtt)
        || time(before.jitter, now.jitter)
        || share(before.loss, now.loss)
        || share(before.loss_out, now.loss_out)
        || share(before.loss_in, now.loss_in)
}
