//! Processes of components: started, watched, told, ended.
//!
//! ```text
//!  Effect::Launch, Command ─▶ Supervisor ─▶ one Keeper task a process ─▶ InstanceNews
//!                                 ▲ hello        ▲ pidfd, socket lines, timers
//!                              socket ◀──────── component
//! ```

mod instance;
mod journal;
mod keeper;
mod keepsake;
mod launch;
mod logs;
mod pidfd;
mod process;
mod samples;
mod socket;
mod survivors;

use std::cell::RefCell;
use std::collections::BTreeMap;
use std::path::PathBuf;
use std::rc::Rc;
use std::time::Duration;
use std::{fs, io};

use sdr_component::protocol::SharedMemory;
use sdr_core::{
    effect::{Command, LaunchOrder},
    id::ComponentKey,
    input::{Adoption, Input, InstanceId, InstanceNews},
    spec::{ComponentSpec, OnAgentDeath},
};
use sdr_files::robot::Cgroup;
use tokio::sync::mpsc;

use crate::limits::{Limiter, OomWatch};
use crate::metrics::Watch;
use crate::record::RecordSender;
use crate::taps::PortTypes;
use crate::trouble::Trouble;
use journal::Journal;
use keeper::{Keeper, Message};
pub(crate) use launch::{executables, find};
pub(crate) use logs::{LogFiles, lines_at_end};
use process::Process;
pub(crate) use survivors::{Survivor, find as find_survivors};

/// Messages that may wait for one keeper.
const MAILBOX_MAX: usize = 64;
/// How long all components have to end when the agent stops; their keepers kill long before.
const STOP_MAX: Duration = Duration::from_secs(5);

/// How processes are started and how patient their keepers are.
#[derive(Clone, Debug)]
pub(crate) struct SupervisorConfig {
    /// Folders with executables, in this order.
    pub(crate) path: Vec<PathBuf>,
    /// Where components greet the agent.
    pub(crate) socket: PathBuf,
    /// Folder of the journal.
    pub(crate) state: PathBuf,
    /// Output of components.
    pub(crate) logs: LogFiles,
    /// Whether they go on without the agent, unless their system says otherwise.
    pub(crate) on_agent_death: OnAgentDeath,
    /// Files of the robot's devices.
    pub(crate) devices: BTreeMap<String, String>,
    /// Where samples lie.
    pub(crate) memory: SharedMemory,
    /// Where limits are enforced.
    pub(crate) cgroup: Cgroup,
    /// Bars of the watch.
    pub(crate) patience: Patience,
}

impl SupervisorConfig {
    /// What becomes of a component when the agent dies.
    fn on_agent_death_of(&self, spec: &ComponentSpec) -> OnAgentDeath {
        spec.on_agent_death.unwrap_or(self.on_agent_death)
    }
}

/// How long a component may take.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Patience {
    /// From the start of the process to its greeting.
    pub(crate) hello: Duration,
    /// From `configure` to the state inactive; `on_initialize` may touch much memory.
    pub(crate) initialize: Duration,
    /// Between two beats while active, at least; five periods when that is longer.
    pub(crate) beat: Duration,
    /// Between two beats while inactive, likewise.
    pub(crate) beat_idle: Duration,
    /// From an order to the state that answers it, and from `finalized` to the exit.
    pub(crate) order: Duration,
    /// From the end of a connection to the next greeting.
    pub(crate) reconnect: Duration,
    /// From `finish` to SIGTERM.
    pub(crate) finish: Duration,
    /// From SIGTERM to SIGKILL.
    pub(crate) terminate: Duration,
}

impl Default for Patience {
    fn default() -> Self {
        Self {
            hello: Duration::from_secs(10),
            initialize: Duration::from_secs(60),
            beat: Duration::from_secs(1),
            beat_idle: Duration::from_secs(3),
            order: Duration::from_secs(15),
            reconnect: Duration::from_secs(3),
            finish: Duration::from_secs(1),
            terminate: Duration::from_secs(2),
        }
    }
}

/// Ways for news of components.
#[derive(Clone, Debug)]
pub(crate) struct Outlets {
    /// To the brain.
    pub(crate) inputs: mpsc::Sender<Input>,
    /// To the sampler.
    pub(crate) watch: Watch,
    /// To the recording.
    pub(crate) record: RecordSender,
    /// For garbage.
    pub(crate) trouble: Trouble,
    /// To those who record ports.
    pub(crate) types: PortTypes,
}

/// Starts and commands processes. Lives on the loop's thread, within a `LocalSet`.
#[derive(Debug)]
pub(crate) struct Supervisor {
    shared: Rc<Shared>,
}

/// What all keepers use.
#[derive(Debug)]
struct Shared {
    config: SupervisorConfig,
    outlets: Outlets,
    journal: Journal,
    limiter: Limiter,
    oom: OomWatch,
    kept: RefCell<BTreeMap<InstanceId, Kept>>,
}

/// How a keeper is reached.
#[derive(Clone, Debug)]
struct Kept {
    component: ComponentKey,
    on_agent_death: OnAgentDeath,
    /// 0 until the process runs.
    pid: u32,
    badge: String,
    mailbox: mpsc::Sender<Message>,
}

impl Supervisor {
    /// Goes on with `survivors` and opens the components' socket. What it returns is to be
    /// told to the brain before anything else.
    pub(crate) fn start(
        config: SupervisorConfig,
        outlets: Outlets,
        survivors: Vec<Survivor>,
    ) -> io::Result<(Self, Vec<Input>)> {
        fs::create_dir_all(&config.logs.dir)?;
        let socket = config.socket.clone();
        let shared = Rc::new(Shared {
            journal: Journal::new(&config.state),
            limiter: Limiter::open(&config.cgroup),
            oom: OomWatch::new(),
            config,
            outlets,
            kept: RefCell::default(),
        });
        let supervisor = Self { shared };
        // Before they can greet: who is not known is sent away.
        let adopted = survivors.into_iter().filter_map(|survivor| supervisor.adopt(survivor));
        let adopted = adopted.collect();
        socket::listen(&socket, Rc::clone(&supervisor.shared))?;
        tokio::task::spawn_local(logs::bound(Rc::downgrade(&supervisor.shared)));
        Ok((supervisor, adopted))
    }

    fn adopt(&self, survivor: Survivor) -> Option<Input> {
        let component = survivor.order.component.clone();
        let adopted = Process::adopt(survivor).map_err(|error| {
            tracing::error!(event = "not-adopted", %component, %error, next = "it goes on unwatched");
        });
        let (order, process) = adopted.ok()?;
        let instance = order.instance;
        let adoption = Adoption {
            pid: process.id(),
            component,
            spec: order.spec.clone(),
            inputs: order.inputs.clone(),
        };
        let messages = self.enlist(&order);
        let keeper = Keeper::adopt(Rc::clone(&self.shared), order, process);
        tokio::task::spawn_local(keeper.stay(messages));
        Some(Input::Instance { instance, news: InstanceNews::Adopted(Box::new(adoption)) })
    }

    /// Makes the mailbox of a keeper.
    fn enlist(&self, order: &LaunchOrder) -> mpsc::Receiver<Message> {
        let (mailbox, messages) = mpsc::channel(MAILBOX_MAX);
        let component = order.component.clone();
        let on_agent_death = self.shared.config.on_agent_death_of(&order.spec);
        let kept = Kept { component, on_agent_death, pid: 0, badge: String::new(), mailbox };
        self.shared.kept.borrow_mut().insert(order.instance, kept);
        messages
    }

    /// Starts a process; what comes of it is instance news.
    pub(crate) fn launch(&self, order: LaunchOrder) {
        let messages = self.enlist(&order);
        tokio::task::spawn_local(Keeper::keep(Rc::clone(&self.shared), order, messages));
    }

    /// Tells an instance something; nothing happens when it is gone, which was said already.
    pub(crate) fn command(&self, instance: InstanceId, command: Command) {
        let kept = self.shared.kept.borrow().get(&instance).cloned();
        let Some(kept) = kept else { return };
        if kept.mailbox.try_send(Message::Command(command)).is_err() {
            tracing::warn!(event = "command-lost", instance, component = %kept.component);
        }
    }

    /// Ends components, and the socket when none is left.
    pub(crate) async fn stop(&self, whom: Whom) -> Left {
        let all: Vec<Kept> = self.shared.kept.borrow().values().cloned().collect();
        let ends = |kept: &Kept| whom == Whom::All || kept.on_agent_death == OnAgentDeath::Stop;
        let all: Vec<Kept> = all.into_iter().filter(ends).collect();
        for kept in &all {
            // A full mailbox belongs to a keeper that is being told to end already.
            let _ = kept.mailbox.try_send(Message::Command(Command::Finish));
        }
        let ended = async {
            for kept in &all {
                kept.mailbox.closed().await;
            }
        };
        if tokio::time::timeout(STOP_MAX, ended).await.is_err() {
            tracing::error!(event = "components-left", "some processes could not be ended");
        }
        if !self.shared.journal.is_empty() {
            return Left::Some;
        }
        remove_if_there(&self.shared.config.socket);
        remove_if_there(self.shared.journal.path());
        Left::Nothing
    }
}

/// Which components end with the agent.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Whom {
    /// All.
    All,
    /// Those that are not to be kept.
    NotKept,
}

/// What runs on after the agent.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Left {
    /// No component.
    Nothing,
    /// Some components.
    Some,
}

impl Shared {
    /// Tells the brain.
    async fn tell(&self, instance: InstanceId, news: InstanceNews) {
        // The loop is gone only when the agent ends.
        let _ = self.outlets.inputs.send(Input::Instance { instance, news }).await;
    }
}

fn remove_if_there(path: &std::path::Path) {
    match fs::remove_file(path) {
        Ok(()) => {}
        Err(error) if error.kind() == io::ErrorKind::NotFound => {}
        Err(error) => tracing::warn!(event = "not-removed", path = %path.display(), %error),
    }
}

#[cfg(test)]
pub(crate) mod tests;
