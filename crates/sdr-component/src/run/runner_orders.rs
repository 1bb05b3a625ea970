//! What the agent wants, carried out on the execution thread.

use std::sync::Arc;

use sdr_core::{
    lifecycle::{Callback, LifecycleState, Transition},
    order::Token,
    recover::Fault,
};

use super::{ballast, link::News, runner::Runner, ticker::Ticker};
use crate::{
    clock,
    component::{Component, ComponentError},
    protocol::{
        Configure, ErrorReport, FromComponent, Order, PROTOCOL_VERSION, Reconfigure, ToComponent,
    },
    setup::{Setup, Wiring, check_known},
    shm::Memory,
};

impl<C: Component> Runner<C> {
    /// Carries out everything that came; a refused order is answered and changes nothing.
    pub(super) fn take_news(&mut self) {
        while let Some(news) = self.link.next_news() {
            let result = match news {
                News::Connected => self.greet(),
                News::Said(ToComponent::Configure(configure)) => self.configure(*configure),
                News::Said(ToComponent::Command(order)) => self.obey(order),
                News::Said(ToComponent::Reconfigure(change)) => self.reconfigure(change),
                News::Said(ToComponent::Error(error)) => {
                    crate::log(format_args!("{}: the agent says: {}", C::NAME, error.message));
                    Ok(())
                }
                News::Alone => self.stop_alone(),
                News::Orphaned => {
                    self.is_orphan = true;
                    self.finish()
                }
                News::Stop => self.finish(),
            };
            if let Err(message) = result {
                crate::log(format_args!("{}: refused: {message}", C::NAME));
                self.link.outbox.say(FromComponent::Error(ErrorReport { message }));
            }
            if self.life.state() == LifecycleState::Finalized {
                return;
            }
        }
    }

    /// A new agent knows the state from the greeting; what was heard it learns here.
    fn greet(&mut self) -> Result<(), String> {
        let now_ns = clock::monotonic_ns();
        for input in &self.inputs {
            for connection in &input.lock().connections {
                if let Some(heard) = connection.heard(now_ns) {
                    self.link.outbox.say(FromComponent::Heard(heard));
                }
            }
        }
        Ok(())
    }

    fn configure(&mut self, configure: Configure) -> Result<(), String> {
        if self.life.state() != LifecycleState::Created {
            return Err(String::from("configured already; end this process and start another"));
        }
        if configure.v != PROTOCOL_VERSION {
            let (found, known) = (configure.v, PROTOCOL_VERSION);
            return Err(format!("protocol version {found}; this component speaks {known}"));
        }
        if configure.component != self.identity.component {
            let (found, own) = (&configure.component, &self.identity.component);
            return Err(format!("configured as {found}; this is {own}"));
        }
        let name = format!("{}#{}", self.identity.component, self.identity.instance);
        let memory = match Memory::open(&configure.memory, &name) {
            Ok(memory) => Arc::new(memory),
            Err(error) => {
                self.take(Transition::Initialize)?;
                self.fail(ComponentError::from(error).into());
                return Ok(());
            }
        };
        self.ticker = Ticker::new(configure.execution);
        self.wiring = Some(Wiring { configure: Arc::new(configure), memory });
        self.take(Transition::Initialize)?;
        self.initialize();
        Ok(())
    }

    /// Makes the component and initialises it, at first and after a reset when it never came
    /// up; the state is Inactive already and becomes Error when that fails.
    fn initialize(&mut self) {
        match self.try_initialize() {
            Ok(()) => {
                self.is_initialized = true;
                self.fault = None;
                self.report_state();
            }
            Err(fault) => self.fail(fault),
        }
    }

    fn try_initialize(&mut self) -> Result<(), Fault> {
        // The old ports go before the new ones come: a port has only so many users.
        self.component = None;
        self.inputs.clear();
        self.outputs.clear();
        let Some(wiring) = self.wiring.clone() else {
            return Err(ComponentError::other("shared memory could not be opened").into());
        };
        if self.ballast.is_none() {
            self.ballast = ballast::allocate(&wiring.configure)?;
        }
        let mut setup = Setup::new::<C>(Some(wiring));
        let component = C::new(&mut setup)?;
        setup.check_complete().map_err(ComponentError::from)?;
        self.component = Some(component);
        self.inputs = setup.inputs;
        self.outputs = setup.outputs;
        self.call(Callback::OnInitialize)
    }

    fn obey(&mut self, order: Order) -> Result<(), String> {
        match order {
            Order::Activate { token } => self.activate(token),
            Order::Deactivate => self.deactivate(),
            Order::Finish => self.finish(),
            Order::Reset => self.reset(),
        }
    }

    fn activate(&mut self, token: Token) -> Result<(), String> {
        if let Some(present) = &self.token {
            if token < *present {
                return Err(format!("token {token} is older than {present}"));
            }
            if token > *present {
                self.set_token(token);
            }
            self.report_state();
            return Ok(());
        }
        let owed = self.take(Transition::Activate)?;
        self.set_token(token);
        for input in &self.inputs {
            input.lock().listen();
        }
        self.ticker.start(clock::monotonic_ns());
        self.owe(owed);
        Ok(())
    }

    fn deactivate(&mut self) -> Result<(), String> {
        let owed = self.take(Transition::Deactivate)?;
        // The last figures of this activation, before the window closes.
        self.report_counters(clock::monotonic_ns());
        self.silence();
        self.owe(owed);
        Ok(())
    }

    /// Nobody is there who could stop it, or hear others: it must not act any more.
    fn stop_alone(&mut self) -> Result<(), String> {
        if self.life.state() != LifecycleState::Active {
            return Ok(());
        }
        crate::log(format_args!("{}: without an agent for too long; deactivated", C::NAME));
        self.deactivate()
    }

    fn reset(&mut self) -> Result<(), String> {
        let owed = self.take(Transition::Reset)?;
        if owed.is_some() && !self.is_initialized {
            self.initialize();
            return Ok(());
        }
        self.fault = None;
        self.owe(owed);
        Ok(())
    }

    fn finish(&mut self) -> Result<(), String> {
        if self.life.state() == LifecycleState::Active {
            self.deactivate()?;
        }
        if let Some(callback) = self.take(Transition::Finalize)?
            && let Err(fault) = self.call(callback)
        {
            crate::log(format_args!("{}: while finishing: {}", C::NAME, fault.reason));
        }
        self.ballast = None;
        self.report_state();
        Ok(())
    }

    fn reconfigure(&mut self, change: Reconfigure) -> Result<(), String> {
        let Some(wiring) = &mut self.wiring else {
            return Err(String::from("not configured yet"));
        };
        check_known(&self.profile, &change.parameters).map_err(|error| error.to_string())?;
        let mut configure = Configure::clone(&wiring.configure);
        configure.parameters.extend(change.parameters.clone());
        let execution = change.execution.filter(|execution| *execution != configure.execution);
        if let Some(execution) = execution {
            configure.execution = execution;
        }
        wiring.configure = Arc::new(configure);
        let mut outcome = Ok(());
        if !change.parameters.is_empty() {
            let changed = &change.parameters;
            outcome = self.with_component(|component, context| {
                component.on_parameters_changed(changed, context)
            });
        }
        if let Some(execution) = execution {
            self.ticker.set(execution);
            outcome = outcome.and_then(|()| self.call(Callback::OnRateChanged));
        }
        match outcome {
            Ok(()) => self.report_state(),
            Err(fault) => self.fail(fault),
        }
        Ok(())
    }

    /// Runs the callback that a transition owes and says where that led.
    fn owe(&mut self, owed: Option<Callback>) {
        match owed.map_or(Ok(()), |callback| self.call(callback)) {
            Ok(()) => self.report_state(),
            Err(fault) => self.fail(fault),
        }
    }

    fn take(&mut self, transition: Transition) -> Result<Option<Callback>, String> {
        self.life.take(transition).map_err(|error| error.to_string())
    }
}
