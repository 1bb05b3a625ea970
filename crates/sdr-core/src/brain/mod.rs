//! The one place where decisions are made: inputs in, effects out.
//!
//! ```text
//! handle(input) ─▶ take it in (mesh, instances, store, plans)
//!               ─▶ settle:  role ─▶ judge ─▶ decide ─▶ reconcile ─▶ say ─▶ routes ─▶ store
//!                           (who   (own     (where     (what runs  (what  (DDS)   (disk)
//!                           leads) trouble) things go) here)       I am)
//! ```
//!
//! `decide` acts only on the coordinator, and only mints records; every robot `reconcile`s
//! what should be on itself with what is. Nothing is ever told to another robot but records.

mod burial;
mod conditions;
mod config;
mod deadlines;
mod decide;
mod editions;
mod effects;
mod epochs;
mod evidence;
mod fitness;
mod gone;
mod guard;
mod handover;
mod index;
mod instances;
mod isolation;
mod judge;
mod launch;
mod minting;
mod moves;
mod newborn;
mod news;
mod plans;
mod policies;
mod prepare;
mod problem;
mod reconcile;
mod requests;
mod role;
mod role_requests;
mod routes;
mod say;
mod spare;
mod standbys;
mod status;
mod systems;
mod takeover;
#[cfg(test)]
mod tests;

use alloc::{
    boxed::Box,
    collections::{BTreeMap, BTreeSet, VecDeque},
    string::String,
    sync::Arc,
};

pub use config::{BrainConfig, CheckAllocation, MakeRecovery, Seams};

use crate::{
    allocate::Refusal,
    api::StatusView,
    effect::{Effect, StoredState},
    id::{ComponentKey, Name, RobotId},
    input::{Input, InstanceId},
    mesh::{FleetTable, Incarnation, Mesh},
    planted::{self, Defect},
    recover::{Cause, Fault},
    report::{ConditionReport, HostReport},
    time::{Duration, Instant},
};
use burial::Burial;
use editions::Editions;
use epochs::EpochBook;
use guard::GuardDesk;
use index::{Index, Stir};
use instances::{Instance, RunBook};
use isolation::Lease;
use judge::{Engine, Objector, RestartPlan};
use minting::Desk;
use moves::MoveWatch;
use plans::PlanDesk;
use role::RoleDesk;
use say::Said;
use spare::SparePlan;
use systems::SystemNow;

/// A handler that was not called for so long was itself paused: it judges nobody by it.
const PAUSE_MIN: Duration = Duration::from_millis(800);

/// Without any sign, everything is looked at again so often.
const LOOK_EVERY: Duration = Duration::from_secs(1);
/// What was decided is looked at at once, so many times.
const SETTLE_ROUNDS_MAX: usize = 4;

/// The decisions of one robot as a state machine without I/O.
///
/// After each [`Brain::handle`], poll effects until `None` before the next `handle`.
#[derive(Debug)]
pub struct Brain {
    config: BrainConfig,
    me: RobotId,
    /// Addresses to begin with, but this robot's own.
    seeds_of_others: usize,
    seams: Seams,
    mesh: Mesh,
    effects: VecDeque<Effect>,
    started_at: Instant,
    handled_at: Instant,

    systems: BTreeMap<Name, Arc<SystemNow>>,
    index: Index,
    stir: Stir,
    /// Everything is looked at again at this time at the latest.
    look_at: Instant,
    /// It may start what it remembers.
    began: bool,
    /// Since when a newborn is in step with a peer.
    met_at: Option<Instant>,
    instances: BTreeMap<InstanceId, Instance>,
    instance_last: InstanceId,
    runs: BTreeMap<ComponentKey, RunBook>,
    matched: BTreeMap<String, u16>,
    routes: alloc::vec::Vec<crate::effect::Route>,

    host: Option<HostReport>,
    said: Said,
    engines: BTreeMap<Name, Engine>,
    /// One engine for each recovery policy of the fleet, to ask what it objects to.
    objectors: alloc::vec::Vec<Objector>,
    /// Recovery policies that could not be read; each is told once.
    unreadable: BTreeMap<Name, Arc<crate::spec::PolicyBytes>>,
    faults: BTreeMap<ComponentKey, Fault>,
    conditions: BTreeMap<(Name, Cause), ConditionReport>,
    /// How long what is foreseen stays said.
    foreseen_until: BTreeMap<(Name, Cause), Instant>,
    restarts: BTreeMap<ComponentKey, RestartPlan>,
    held: BTreeMap<ComponentKey, String>,
    /// Components that failed here and wait for their ladder's word.
    failed: BTreeSet<ComponentKey>,
    judge_due: bool,
    usage_due: bool,
    timer_at: Option<Instant>,
    drains: BTreeMap<ComponentKey, Instant>,
    spare_plans: BTreeMap<ComponentKey, SparePlan>,
    epochs: BTreeMap<ComponentKey, EpochBook>,
    guard: GuardDesk,
    /// When this robot listed standbys of a component, not long ago.
    listed: BTreeMap<ComponentKey, Instant>,
    /// Components that wish for a standby on another robot, and why none takes it.
    unbacked: BTreeMap<ComponentKey, alloc::vec::Vec<Refusal>>,

    plans: PlanDesk,
    moves: BTreeMap<ComponentKey, MoveWatch>,
    left: BTreeMap<(ComponentKey, RobotId), Instant>,
    /// Homes that others chose lately: until when they have time to speak.
    homes_told: BTreeMap<ComponentKey, Instant>,
    burial: Burial,
    desk: Desk,
    editions: Editions,
    desk_of_role: RoleDesk,
    lease: Lease,
    duplicates_told: BTreeSet<core::net::SocketAddr>,
}

impl Brain {
    /// A brain that continues from what its robot had on disk.
    ///
    /// It is mute until its new incarnation has reached the disk.
    pub fn new(
        config: BrainConfig,
        seams: Seams,
        stored: Option<StoredState>,
        now: Instant,
    ) -> Box<Self> {
        // with an empty disk it is newborn: others may still know it, and correct it (rule 7)
        let lives = stored.as_ref().map_or(0, |stored| stored.incarnation);
        let counter = if lives == 0 { 0 } else { lives.saturating_add(1) };
        let stored = stored.unwrap_or_default();
        let own = Incarnation { counter, nonce: u32::try_from(config.seed >> 32).unwrap_or(0) };
        let fleet = FleetTable::new(&stored.fleet, seams.commons.clone());
        let mesh = Mesh::new(config.of_mesh(), own, fleet, &stored.peers, now);
        let runs = stored.runs.into_iter().filter(|_| !planted::is(Defect::RunNotReserved));
        let runs = runs.map(|(key, run)| (key, RunBook::from_disk(run)));
        let epochs = stored.epochs.into_iter();
        let epochs = epochs.map(|(key, number)| (key, EpochBook::from_disk(number)));
        let mut brain = Box::new(Self {
            me: config.robot.clone(),
            seeds_of_others: config.seeds_of_others(),
            config,
            seams,
            mesh,
            effects: VecDeque::new(),
            started_at: now,
            handled_at: now,
            systems: BTreeMap::new(),
            index: Index::default(),
            stir: Stir::ALL,
            look_at: now,
            began: false,
            met_at: None,
            instances: BTreeMap::new(),
            instance_last: 0,
            runs: runs.collect(),
            matched: BTreeMap::new(),
            routes: alloc::vec::Vec::new(),
            host: None,
            said: Said::default(),
            engines: BTreeMap::new(),
            objectors: alloc::vec::Vec::new(),
            unreadable: BTreeMap::new(),
            faults: BTreeMap::new(),
            conditions: BTreeMap::new(),
            foreseen_until: BTreeMap::new(),
            restarts: BTreeMap::new(),
            held: BTreeMap::new(),
            failed: BTreeSet::new(),
            judge_due: false,
            usage_due: false,
            timer_at: None,
            drains: BTreeMap::new(),
            spare_plans: BTreeMap::new(),
            epochs: epochs.collect(),
            guard: GuardDesk::default(),
            listed: BTreeMap::new(),
            unbacked: BTreeMap::new(),
            plans: PlanDesk::default(),
            moves: BTreeMap::new(),
            left: BTreeMap::new(),
            homes_told: BTreeMap::new(),
            burial: Burial::new(stored.robots),
            desk: Desk::default(),
            editions: Editions::default(),
            desk_of_role: RoleDesk::default(),
            lease: Lease::default(),
            duplicates_told: BTreeSet::new(),
        });
        brain.refresh_all_systems();
        brain.say_facts();
        brain.store_now();
        brain.timer_at = brain.next_timer();
        brain
    }

    /// Takes one input at `now`; time never goes back.
    pub fn handle(&mut self, now: Instant, input: Input) {
        let pause = now.since(self.handled_at);
        if pause >= PAUSE_MIN {
            self.mesh.forgive_pause(pause);
        }
        self.handled_at = now;
        self.stir_for(&input);
        self.take(now, input);
        self.settle(now);
    }

    /// What an input makes worth looking at; datagrams do so by their news.
    fn stir_for(&mut self, input: &Input) {
        match input {
            Input::Tick | Input::Datagram { .. } => {}
            Input::Host(_) => self.judge_due = true,
            Input::Usage(_) => self.usage_due = true,
            Input::Facts(_)
            | Input::Instance { .. }
            | Input::Route { .. }
            | Input::Deploy { .. }
            | Input::Undeploy { .. }
            | Input::MoveRole { .. }
            | Input::RolePolicy { .. }
            | Input::Planned { .. }
            | Input::Stored { .. }
            | Input::StoreFailed { .. } => self.stir = Stir::ALL,
        }
    }

    fn take(&mut self, now: Instant, input: Input) {
        match input {
            Input::Tick => {}
            Input::Datagram { from, bytes } => self.mesh.handle_datagram(now, from, &bytes),
            Input::Host(host) => self.host = Some(host),
            Input::Facts(facts) => {
                self.config.facts = *facts;
                self.say_facts();
                self.plans.retry_soon();
            }
            Input::Usage(figures) => self.handle_usage(figures),
            Input::Instance { instance, news } => self.handle_instance(now, instance, news),
            Input::Route { path, matched } => {
                self.matched.insert(path, matched);
            }
            Input::Deploy { request, system } => self.handle_deploy(request, system),
            Input::Undeploy { request, system } => self.handle_undeploy(request, &system),
            Input::MoveRole { request, to } => self.handle_move_role(request, &to),
            Input::RolePolicy { request, policy } => self.handle_role_policy(request, *policy),
            Input::Planned { plan, result } => self.handle_planned(now, plan, result),
            Input::Stored { ticket } => self.handle_stored(ticket),
            Input::StoreFailed { ticket, reason } => self.handle_store_failed(ticket, &reason),
        }
    }

    /// The next order to the shell.
    pub fn poll_effect(&mut self) -> Option<Effect> {
        self.effects.pop_front()
    }

    /// What this robot believes of the fleet, for the API.
    pub fn status(&self, now: Instant) -> StatusView {
        self.status_view(now)
    }

    /// Whether this robot decides for others now: it holds the role, and hears somebody.
    pub fn coordinates(&self) -> bool {
        self.is_coordinator()
    }

    /// The robot whose brain it is.
    pub fn robot(&self) -> &RobotId {
        &self.me
    }

    /// What this robot knows of the fleet, to look at.
    pub fn mesh(&self) -> &Mesh {
        &self.mesh
    }

    /// Where the sent bytes of the mesh went.
    pub fn mesh_traffic(&self) -> crate::mesh::MeshTraffic {
        self.mesh.traffic()
    }

    /// Counters of the mesh, for metrics.
    pub fn mesh_counters(&self) -> crate::mesh::MeshCounters {
        self.mesh.counters()
    }

    /// Brings everything into agreement with what was just learnt.
    fn settle(&mut self, now: Instant) {
        self.mesh.handle_tick(now);
        self.take_news(now);
        self.notice_time(now);
        self.consider_role(now);
        self.watch_homes(now);
        if self.lease.wake_at.is_none_or(|at| now >= at) || self.stir.here {
            self.keep_lease(now);
        }
        // before anything is reconciled: what failed must not be started behind the ladder's back
        if self.judge_due || self.engines.values().any(|engine| engine.is_due(now)) {
            self.judge(now);
        }
        for _ in 0..SETTLE_ROUNDS_MAX {
            let stir = core::mem::take(&mut self.stir);
            if !stir.any() {
                break;
            }
            if stir.fleet {
                self.decide(now);
            }
            if stir.here {
                self.reconcile(now);
                self.keep_beats();
                self.say_instances(now);
                self.update_routes();
            }
        }
        self.say(now);
        self.store_if_dirty(now);
        if self.desk.may_speak() {
            while let Some((to, bytes)) = self.mesh.poll_send() {
                self.effects.push_back(Effect::Send { to, bytes });
            }
        }
        self.timer_at = self.next_timer();
    }

    /// A timer passed, the start is over, or nothing was looked at for long.
    fn notice_time(&mut self, now: Instant) {
        self.consider_growing_up(now);
        let begins = !self.began && self.may_begin(now);
        self.began |= begins;
        if begins || now >= self.look_at || self.timer_at.is_some_and(|at| now >= at) {
            self.stir = Stir::ALL;
            self.look_at = now + LOOK_EVERY;
        }
    }

    /// Whether this robot may start what it remembers: it is in step with a peer, or waited
    /// for one long enough.
    fn may_begin(&self, now: Instant) -> bool {
        let alone = self.seeds_of_others == 0;
        !self.is_newborn() && (self.mesh.is_in_step() || alone || now >= self.begin_deadline())
    }

    fn begin_deadline(&self) -> Instant {
        self.started_at + self.config.rejoin_wait
    }
}
