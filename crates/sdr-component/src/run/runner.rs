//! The execution thread: waits, accepts samples, calls the component, reports.

use std::os::fd::AsFd;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::process::ExitCode;

use rustix::event::{PollFd, PollFlags, Timespec, poll};
use sdr_core::{
    lifecycle::{Callback, Lifecycle, LifecycleState, Transition},
    order::Token,
    recover::{Cause, Fault},
    spec::ComponentProfile,
};

use super::{identity::Identity, link::Link, ticker::Ticker};
use crate::{
    clock,
    component::{Component, ComponentError, Context, Wishes},
    port::{SharedInput, SharedOutput},
    protocol::{
        BEAT_PERIOD, COUNTERS_PERIOD, Counters, ExecutionSetup, FromComponent, StateReport,
    },
    setup::Wiring,
    sys::TouchedMemory,
};

/// The execution thread of one component.
pub(super) struct Runner<C: Component> {
    pub(super) identity: Identity,
    pub(super) profile: ComponentProfile,
    pub(super) link: Link,
    pub(super) life: Lifecycle,
    /// Made from the configuration; made anew by a reset when it never came up.
    pub(super) component: Option<C>,
    pub(super) is_initialized: bool,
    pub(super) inputs: Vec<SharedInput>,
    pub(super) outputs: Vec<SharedOutput>,
    pub(super) token: Option<Token>,
    pub(super) fault: Option<Fault>,
    pub(super) ticker: Ticker,
    pub(super) ballast: Option<TouchedMemory>,
    pub(super) is_orphan: bool,
    beat_due_ns: u64,
    counters_due_ns: u64,
    /// Last: ports are gone before the memory they live in.
    pub(super) wiring: Option<Wiring>,
}

impl<C: Component> Runner<C> {
    pub(super) fn new(identity: Identity, profile: ComponentProfile, link: Link) -> Self {
        Self {
            identity,
            profile,
            link,
            life: Lifecycle::default(),
            component: None,
            is_initialized: false,
            inputs: Vec::new(),
            outputs: Vec::new(),
            token: None,
            fault: None,
            ticker: Ticker::new(ExecutionSetup::OnData),
            ballast: None,
            is_orphan: false,
            beat_due_ns: 0,
            counters_due_ns: 0,
            wiring: None,
        }
    }

    /// Until the end of the process.
    pub(super) fn run(mut self) -> ExitCode {
        while self.life.state() != LifecycleState::Finalized {
            self.wait();
            self.take_news();
            let accepted = self.accept();
            self.tick_when_due(accepted > 0);
            self.report_when_due();
        }
        let code = if self.is_orphan { ExitCode::FAILURE } else { ExitCode::SUCCESS };
        let Self { component, inputs, outputs, wiring, link, .. } = self;
        drop((component, inputs, outputs, wiring));
        link.close();
        code
    }

    /// Sleeps until there is news, a sample, or something to do.
    fn wait(&self) {
        let now_ns = clock::monotonic_ns();
        let is_error = self.life.state() == LifecycleState::Error;
        let mut due_ns = self.beat_due_ns.min(self.counters_due_ns);
        if self.life.on_tick().is_some() {
            due_ns = due_ns.min(self.ticker.due_ns(is_error).unwrap_or(u64::MAX));
        }
        let Some(left_ns) = due_ns.checked_sub(now_ns).filter(|left| *left > 0) else { return };
        let limit = Timespec::try_from(std::time::Duration::from_nanos(left_ns)).ok();
        // Nobody else locks the inputs while this thread sleeps.
        let listening = self.life.state() == LifecycleState::Active;
        let cores: Vec<_> =
            self.inputs.iter().filter(|_| listening).map(SharedInput::lock).collect();
        let connections = cores.iter().flat_map(|core| &core.connections);
        let mut fds = vec![PollFd::new(&self.link.wake, PollFlags::IN)];
        fds.extend(
            connections
                .clone()
                .map(|one| PollFd::from_borrowed_fd(one.subscriber.as_fd(), PollFlags::IN)),
        );
        // A signal only ends the wait early.
        if poll(&mut fds, limit.as_ref()).is_ok() {
            let awake: Vec<bool> = fds.iter().map(|fd| !fd.revents().is_empty()).collect();
            for (connection, _) in connections.zip(&awake[1..]).filter(|(_, awake)| **awake) {
                connection.subscriber.clear_wakes();
            }
        }
        self.link.wake.clear();
    }

    fn accept(&mut self) -> usize {
        let mut accepted = 0;
        for input in &self.inputs {
            let mut core = input.lock();
            accepted += core.accept();
            for heard in core.heard.drain(..) {
                self.link.outbox.say(FromComponent::Heard(heard));
            }
        }
        accepted
    }

    fn tick_when_due(&mut self, has_data: bool) {
        let Some(callback) = self.life.on_tick() else { return };
        let now_ns = clock::monotonic_ns();
        let is_error = callback == Callback::OnError;
        let is_due = match self.ticker.due_ns(is_error) {
            Some(due_ns) => now_ns >= due_ns,
            None => has_data,
        };
        if !is_due {
            return;
        }
        self.ticker.begin(now_ns, is_error);
        for output in &self.outputs {
            output.lock().set_tick(self.ticker.ticks());
        }
        let outcome = self.call(callback);
        self.ticker.end(clock::monotonic_ns());
        if let Err(fault) = outcome {
            // In the error state the first fault stays the reason.
            if !is_error {
                self.fail(fault);
            }
        }
    }

    fn report_when_due(&mut self) {
        let now_ns = clock::monotonic_ns();
        if now_ns >= self.beat_due_ns {
            self.beat_due_ns = now_ns + clock::nanos(BEAT_PERIOD);
            self.link.outbox.say(FromComponent::Beat(self.ticker.take_beat()));
        }
        if now_ns >= self.counters_due_ns {
            self.counters_due_ns = now_ns + clock::nanos(COUNTERS_PERIOD);
            self.report_counters(now_ns);
        }
    }

    pub(super) fn report_counters(&self, now_ns: u64) {
        if self.inputs.is_empty() && self.outputs.is_empty() {
            return;
        }
        let mut counters = Counters { at_ns: now_ns, ..Counters::default() };
        for output in &self.outputs {
            counters.outputs.push(output.lock().counters());
        }
        for input in &self.inputs {
            let mut core = input.lock();
            counters
                .inputs
                .extend(core.connections.iter_mut().map(|one| one.statistics.take(now_ns)));
        }
        self.link.outbox.say(FromComponent::Counters(counters));
    }

    pub(super) fn report_state(&self) {
        let state = self.life.state();
        // An old fault told with another state would count as a second one.
        let fault = self.fault.clone().filter(|_| state == LifecycleState::Error);
        let token = self.token.clone();
        self.link.outbox.say(FromComponent::State(StateReport { state, token, fault }));
    }

    /// Goes to the error state.
    pub(super) fn fail(&mut self, fault: Fault) {
        crate::log(format_args!("{}: {}: {}", C::NAME, fault.cause, fault.reason));
        let Ok(owed) = self.life.take(Transition::Fail) else { return };
        self.silence();
        self.fault = Some(fault);
        self.ticker.start(clock::monotonic_ns());
        if let Some(callback) = owed
            && let Err(fault) = self.call(callback)
        {
            crate::log(format_args!("{}: while aborting: {}", C::NAME, fault.reason));
        }
        self.report_state();
    }

    /// Outputs write nothing but their safe value and inputs take nothing from here on.
    pub(super) fn silence(&mut self) {
        self.token = None;
        for output in &self.outputs {
            if let Err(error) = output.lock().fall_silent() {
                crate::log(format_args!("{}: the safe value was not sent: {error}", C::NAME));
            }
        }
        for input in &self.inputs {
            input.lock().stop_listening();
        }
    }

    /// Calls the component; errors, panics and raised faults are one.
    pub(super) fn call(&mut self, callback: Callback) -> Result<(), Fault> {
        self.with_component(|component, context| match callback {
            Callback::OnInitialize => component.on_initialize(context),
            Callback::OnActivated => component.on_activated(context),
            Callback::OnExecute => component.on_execute(context),
            Callback::OnDeactivated => component.on_deactivated(context),
            Callback::OnAborting => component.on_aborting(context),
            Callback::OnError => component.on_error(context),
            Callback::OnReset => component.on_reset(context),
            Callback::OnRateChanged => component.on_rate_changed(context),
            Callback::OnFinalize => component.on_finalize(context),
        })
    }

    pub(super) fn with_component(
        &mut self,
        callback: impl FnOnce(&mut C, &mut Context<'_>) -> Result<(), ComponentError>,
    ) -> Result<(), Fault> {
        let Some(component) = &mut self.component else { return Ok(()) };
        let mut wishes = Wishes::default();
        let mut context = Context {
            component: &self.identity.component,
            state: self.life.state(),
            token: self.token.as_ref(),
            tick: self.ticker.ticks(),
            now_ns: clock::monotonic_ns(),
            period_ns: self.ticker.period_ns(),
            wishes: &mut wishes,
        };
        // What a panic left half done is the component's own; it is told by `on_aborting`.
        let result = catch_unwind(AssertUnwindSafe(|| callback(component, &mut context)));
        if wishes.stop {
            self.link.stop();
        }
        match (result, wishes.fault) {
            (Ok(Ok(())), None) => Ok(()),
            (Ok(Ok(())), Some(fault)) => Err(fault),
            (Ok(Err(error)), _) => Err(error.into()),
            (Err(panic), _) => {
                let reason = format!("panic: {}", panic_words(panic.as_ref()));
                Err(Fault { cause: Cause::Error, reason })
            }
        }
    }

    pub(super) fn set_token(&mut self, token: Token) {
        for output in &self.outputs {
            output.lock().set_token(Some(&token));
        }
        self.token = Some(token);
    }
}

fn panic_words(panic: &(dyn std::any::Any + Send)) -> &str {
    match (panic.downcast_ref::<&str>(), panic.downcast_ref::<String>()) {
        (Some(words), _) => words,
        (None, Some(words)) => words,
        (None, None) => "without words",
    }
}
