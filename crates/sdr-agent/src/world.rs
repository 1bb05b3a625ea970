//! Everything round the brain: made in order at the start, ended in order at the stop.

use std::fs::{self, File};
use std::io;
use std::path::{Path, PathBuf};

use rustix::fs::{FlockOperation, flock};
use sdr_component::protocol::SharedMemory;
use sdr_core::{
    brain::{Brain, BrainConfig, Seams},
    effect::StoredState,
    id::RobotId,
    input::Input,
};
use sdr_files::RobotConfig;
use thiserror::Error;
use tokio::sync::{mpsc, watch};

use crate::api::{self, AnswerDesk, Api, ApiError, ApiState, LatestPlan, Profiles, Question};
use crate::blobs::{BlobStore, Parts, StoreError, Streams, StreamsError};
use crate::data::{Data, DataConfig, DataError};
use crate::effects::Effects;
use crate::events::Events;
use crate::installed::Installed;
use crate::mesh::{
    discovery::Discovery,
    keys::{FleetKeys, KeysRefused},
    sealed::Sidings,
    udp::Mesh,
    watch::MeshWatch,
};
use crate::metrics::{Metrics, SensorPorts, Watch};
use crate::programs::Programs;
use crate::record::{self, RecordSender, Recorder, RecorderNews};
use crate::run::Ending;
use crate::store::{self, Remembered, Store};
use crate::supervisor::{self, Left, Outlets, Supervisor, Survivor, Whom};
use crate::taps::{self, Listeners, PortTypes};
use crate::trouble::Trouble;
use crate::{clock, config, memory};

/// Inputs that may wait for the loop.
const INPUTS_MAX: usize = 4096;
/// Questions that may wait for the loop.
const QUESTIONS_MAX: usize = 16;
/// Packets of streams that may wait for the QUIC library.
const PACKETS_MAX: usize = 512;
/// Hints at newer keys that may wait to be followed.
const HINTS_MAX: usize = 16;
/// What blobs may take on the disk, all together.
const BLOBS_BYTES_MAX: u64 = 512 << 20;

/// Why the agent does not start. Nothing was changed on the robot; the operator can mend it.
#[derive(Debug, Error)]
pub(crate) enum StartError {
    /// Another agent holds the folder.
    #[error("{}: another agent uses this state; one robot has one agent", .0.display())]
    StateTaken(PathBuf),
    /// The API does not listen.
    #[error("api: {0}")]
    Api(#[from] ApiError),
    /// The mesh does not listen.
    #[error("mesh: listen at {address}: {source}")]
    Mesh {
        /// From robot.toml.
        address: std::net::SocketAddr,
        /// What the system said.
        source: io::Error,
    },
    /// The keys of robot.toml cannot be used.
    #[error("{0}")]
    Keys(#[from] KeysRefused),
    /// Streams do not start.
    #[error("{0}")]
    Streams(#[from] StreamsError),
    /// There is no place for blobs.
    #[error("blobs: {0}")]
    Blobs(#[from] StoreError),
    /// The data plane does not start.
    #[error("{0}")]
    Data(#[from] DataError),
    /// A driver could not be made.
    #[error("{what}: {source}")]
    Io {
        /// What was tried.
        what: String,
        /// What the system said.
        source: io::Error,
    },
}

/// The drivers and what the loop reads.
#[derive(Debug)]
pub(crate) struct World {
    /// Metrics, mesh, and what came of effects.
    pub(crate) inputs: mpsc::Receiver<Input>,
    /// What the brain must be told before anything else.
    pub(crate) adopted: Vec<Input>,
    /// From the API.
    pub(crate) questions: mpsc::Receiver<Question>,
    /// Who takes orders.
    pub(crate) effects: Effects,
    /// Looks at what the mesh counts.
    pub(crate) mesh_watch: MeshWatch,
    api: Api,
    metrics: Metrics,
    recorder: Option<Recorder>,
    memory: SharedMemory,
    /// Robots that the data plane knows.
    robots: Vec<RobotId>,
    /// Held as long as this agent lives.
    _lock: File,
}

/// What is there before the first driver.
struct Ground {
    lock: File,
    events: Events,
    recorder: Option<Recorder>,
    record: RecordSender,
    stored: Option<StoredState>,
    survivors: Vec<Survivor>,
}

/// What other crates fill in for the brain.
fn seams() -> Seams {
    Seams {
        recovery: Box::new(sdr_recovery::make),
        allocation: Box::new(sdr_alloc::check),
        commons: None,
    }
}

/// What is installed here, and which parts of the body are there.
fn look_around(
    robot: &RobotConfig,
    brain: &BrainConfig,
    inputs: &mpsc::Sender<Input>,
) -> Installed {
    let looked_at = (config::component_path(robot), config::devices(robot));
    Installed::new(looked_at, brain.facts.clone(), inputs.clone())
}

impl World {
    /// Makes everything. Call within a `LocalSet`; who ends the agent by the API tells `ending`.
    pub(crate) async fn start(
        robot: &RobotConfig,
        ending: watch::Sender<Ending>,
    ) -> Result<(Box<Brain>, Self), StartError> {
        let state = &robot.storage.state;
        fs::create_dir_all(state).map_err(at("make", state))?;
        let lock = lock(state)?;
        // Before anything is cleaned: whoever answers there is a living agent.
        let listener = api::open(&robot.api.socket).await?;
        let ground = prepare(robot, lock)?;
        let (inputs, told) = mpsc::channel(INPUTS_MAX);
        let (asker, questions) = mpsc::channel(QUESTIONS_MAX);
        let trouble = Trouble::new(ground.events.clone());

        let keys = FleetKeys::open(robot, &ground.events, &trouble)?;
        let remote = api::open_remote(robot.api.listen).await?;
        let blobs = BlobStore::open(state, BLOBS_BYTES_MAX)?;
        let (mesh, streams) =
            start_mesh(robot, keys.clone(), blobs.clone(), inputs.clone(), &trouble).await?;
        let brain_config = brain_config(robot, keys.as_ref(), &mesh);
        let installed = look_around(robot, &brain_config, &inputs);
        let brain = Brain::new(brain_config, seams(), ground.stored, clock::now());

        let outlets = outlets(inputs.clone(), ground.record, &trouble);
        let (supervisor, adopted) =
            Supervisor::start(config::supervisor(robot), outlets.clone(), ground.survivors)
                .map_err(because("components' socket"))?;
        let parts = Parts::new(blobs.clone(), streams.clone(), inputs.clone());
        let store = Store::start(state.clone(), blobs, inputs.clone(), ground.events.clone())
            .map_err(because("store"))?;
        let (metrics, data) = start_senses(robot, outlets)?;

        let (desk, plan) = (AnswerDesk::default(), LatestPlan::default());
        let api_state = ApiState {
            robot: robot.name.clone(),
            inputs: inputs.clone(),
            questions: asker,
            desk: desk.clone(),
            events: ground.events.clone(),
            trouble: trouble.clone(),
            plan: plan.clone(),
            routes: data.ledger(),
            logs: config::supervisor(robot).logs,
            installed: installed.clone(),
            recording: ground.recorder.as_ref().map(Recorder::flusher),
            profiles: Profiles::new(config::component_path(robot)),
            keys: keys.clone(),
            streams,
            ending,
        };
        let api = Api::start(robot.api.socket.clone(), listener, remote, api_state);
        installed.watch();
        let events = ground.events;
        let path = config::component_path(robot);
        let programs = Programs::new(robot.name.clone(), path, inputs.clone());
        let effects =
            Effects { mesh, store, parts, supervisor, data, desk, events, plan, programs, inputs };
        let world = Self {
            inputs: told,
            adopted,
            questions,
            effects,
            mesh_watch: MeshWatch::new(trouble, keys),
            api,
            metrics,
            recorder: ground.recorder,
            memory: config::shared_memory(robot),
            robots: Vec::new(),
            _lock: ground.lock,
        };
        Ok((brain, world))
    }

    /// Tells the data plane which robots there are, when that changed.
    pub(crate) fn name_robots(&mut self, brain: &Brain) {
        let status = brain.status(clock::now());
        let robots: Vec<RobotId> =
            status.robots.iter().filter_map(|robot| RobotId::new(&robot.name).ok()).collect();
        if robots != self.robots {
            self.effects.data.set_robots(robots.clone());
            self.robots = robots;
        }
    }

    /// Ends everything, the last first; of the components those that `whom` says.
    pub(crate) async fn stop(mut self, whom: Whom) {
        self.api.stop();
        // Nobody reads them any more; whoever sends is told so instead of waiting.
        self.inputs.close();
        let left = self.effects.supervisor.stop(whom).await;
        drop(self.metrics);
        let Effects { data, store, events, .. } = self.effects;
        data.stop();
        drop(store);
        events.publish(events.new_event("agent-stopped", "told to stop"));
        drop(self.recorder);
        match left {
            Left::Some => {}
            Left::Nothing => memory::clean(&self.memory),
        }
    }
}

/// The brain's, with where the mesh listens and looks.
fn brain_config(robot: &RobotConfig, keys: Option<&FleetKeys>, mesh: &Mesh) -> BrainConfig {
    let mut config = config::brain(robot, keys.map(|keys| keys.identity().fleet()));
    config.group = mesh.group();
    config.listen = mesh.local_address().ok().filter(|own| !own.ip().is_unspecified());
    config
}

/// What drivers tell, and to whom.
fn outlets(inputs: mpsc::Sender<Input>, record: RecordSender, trouble: &Trouble) -> Outlets {
    Outlets {
        inputs,
        watch: Watch::default(),
        record,
        trouble: trouble.clone(),
        types: PortTypes::default(),
    }
}

/// Opens the one port of the mesh; with keys it carries streams too.
async fn start_mesh(
    robot: &RobotConfig,
    keys: Option<FleetKeys>,
    store: BlobStore,
    inputs: mpsc::Sender<Input>,
    trouble: &Trouble,
) -> Result<(Mesh, Option<Streams>), StartError> {
    let address = robot.mesh.listen;
    let fleet = config::fleet(robot, keys.as_ref().map(|keys| keys.identity().fleet()));
    let wanted = robot.mesh.discovery.clone();
    let discovery = wanted.map(|interfaces| Discovery::new(&fleet, interfaces));
    let socket = Mesh::open(address).await;
    let socket = socket.map_err(|source| StartError::Mesh { address, source })?;
    let Some(keys) = keys else {
        return Ok((Mesh::start(socket, None, discovery, inputs, trouble.clone()), None));
    };
    let (stream_sender, packets) = mpsc::channel(PACKETS_MAX);
    let (hint_sender, hints) = mpsc::channel(HINTS_MAX);
    let streams = Streams::start(socket.clone(), packets, keys.clone(), store)?;
    streams.follow_hints(hints);
    let sidings = Sidings { streams: stream_sender, hints: hint_sender };
    let mesh = Mesh::start(socket, Some((keys, sidings)), discovery, inputs, trouble.clone());
    Ok((mesh, Some(streams)))
}

/// Reads what was remembered, finds what a predecessor left running, and clears the rest.
fn prepare(robot: &RobotConfig, lock: File) -> Result<Ground, StartError> {
    let state = &robot.storage.state;
    let events = Events::new(robot.name.clone());
    let survivors = supervisor::find_survivors(&config::supervisor(robot), &events);
    if survivors.is_empty() {
        // Nobody uses it: what is there was left by the dead. With survivors, opening it gives
        // back what only the dead used.
        memory::clean(&config::shared_memory(robot));
    }
    let recorder = start_recorder(robot, &events)?;
    let record = match &recorder {
        Some(recorder) => recorder.sender(),
        None => RecordSender::nowhere(&robot.name),
    };
    events.record_into(record.clone());
    let stored = match store::read(state).map_err(at("read the state in", state))? {
        Remembered::Nothing => None,
        Remembered::State(stored) => Some(stored),
        Remembered::Corrupt { set_aside, reason } => {
            let file = set_aside.display();
            let said = format!("{reason}; kept as {file}, starting from what the mesh knows");
            tracing::error!(event = "state-corrupt", %file, %reason);
            events.publish(events.new_event("state-corrupt", said));
            None
        }
    };
    let started = format!("sdr-agent {} on {}", env!("CARGO_PKG_VERSION"), robot.name);
    let pid = f64::from(std::process::id());
    events.publish(events.new_event("agent-started", started).number("pid", pid));
    Ok(Ground { lock, events, recorder, record, stored, survivors })
}

fn start_recorder(robot: &RobotConfig, events: &Events) -> Result<Option<Recorder>, StartError> {
    let Some(wanted) = &robot.storage.recordings else { return Ok(None) };
    // Half for this recording, half for those before it.
    let half = wanted.max.0 / 2;
    record::forget_oldest(&wanted.dir, &robot.name, half);
    let events = events.clone();
    let news = move |news: RecorderNews| events.publish(news.event(&events));
    let recorder = Recorder::start(&wanted.dir, &robot.name, half, news)
        .map_err(at("record into", &wanted.dir))?;
    Ok(Some(recorder))
}

/// Starts what looks at the robot and what carries its samples: ports feel for the metrics.
fn start_senses(robot: &RobotConfig, outlets: Outlets) -> Result<(Metrics, Data), StartError> {
    let Outlets { inputs, watch, record, trouble, types } = outlets;
    let metrics_config = config::metrics(robot);
    let sensors = SensorPorts::new(metrics_config.sensors.clone(), trouble);
    let metrics = Metrics::start(metrics_config, watch, inputs.clone(), record.clone())
        .map_err(because("metrics"))?;
    let listeners = Listeners { recorded: config::recorded_ports(robot), sensors };
    let ports = listeners.ports();
    let data_config = DataConfig {
        robot: robot.name.clone(),
        domain_id: robot.ros.domain_id,
        addresses: robot.ros.addresses.clone(),
        memory: config::shared_memory(robot),
    };
    let data = Data::start(data_config, inputs, taps::sink(types, record, listeners))?;
    data.tap(ports);
    Ok((metrics, data))
}

/// Only one agent may use a state: its numbers must never be given twice.
fn lock(state: &Path) -> Result<File, StartError> {
    let path = state.join("lock");
    let file = File::options().create(true).truncate(false).write(true).open(&path);
    let file = file.map_err(at("open", &path))?;
    match flock(&file, FlockOperation::NonBlockingLockExclusive) {
        Ok(()) => Ok(file),
        Err(rustix::io::Errno::WOULDBLOCK) => Err(StartError::StateTaken(state.into())),
        Err(error) => Err(at("lock", &path)(error.into())),
    }
}

fn at(verb: &str, path: &Path) -> impl FnOnce(io::Error) -> StartError {
    because(format!("{verb} {}", path.display()))
}

fn because(what: impl Into<String>) -> impl FnOnce(io::Error) -> StartError {
    let what = what.into();
    move |source| StartError::Io { what, source }
}
