//! What an author fills in.

use std::collections::BTreeMap;
use std::fmt;

use sdr_core::{
    id::ComponentKey,
    lifecycle::LifecycleState,
    order::Token,
    recover::{Cause, Fault},
    spec::Value,
};

use crate::setup::Setup;

/// A component: one part of a system, with the life cycle of OMG RTC 1.1.
///
/// All callbacks run on one thread, one after the other. One that returns an error or panics
/// puts the component into the error state, with [`Component::on_aborting`] in between when it
/// was active; so does [`Context::raise`].
pub trait Component: Sized {
    /// The name it is launched by, such as `fisheye`.
    const NAME: &'static str;
    /// One sentence for people.
    const ABOUT: &'static str = "";

    /// Declares ports and parameters. Must touch nothing outside: it also runs when the
    /// executable is only asked what it is (`--describe`). Devices are opened in
    /// [`Component::on_initialize`].
    fn new(setup: &mut Setup) -> Result<Self, ComponentError>;

    /// Once, before anything else.
    fn on_initialize(&mut self, _context: &mut Context<'_>) -> Outcome {
        Ok(())
    }

    /// On entering the active state; outputs may be written from here on.
    fn on_activated(&mut self, _context: &mut Context<'_>) -> Outcome {
        Ok(())
    }

    /// Each tick while active. One that runs on data should take all that waits: the next tick
    /// comes with the next sample.
    fn on_execute(&mut self, _context: &mut Context<'_>) -> Outcome {
        Ok(())
    }

    /// On leaving the active state as told; outputs are silent already.
    fn on_deactivated(&mut self, _context: &mut Context<'_>) -> Outcome {
        Ok(())
    }

    /// On leaving the active state because something failed; outputs are silent already.
    fn on_aborting(&mut self, _context: &mut Context<'_>) -> Outcome {
        Ok(())
    }

    /// Each tick while in the error state, at most ten times a second.
    fn on_error(&mut self, _context: &mut Context<'_>) -> Outcome {
        Ok(())
    }

    /// On the way from the error state to inactive. A component whose `new` or
    /// `on_initialize` failed is made anew instead.
    fn on_reset(&mut self, _context: &mut Context<'_>) -> Outcome {
        Ok(())
    }

    /// The period of the execution context changed.
    fn on_rate_changed(&mut self, _context: &mut Context<'_>) -> Outcome {
        Ok(())
    }

    /// Parameters changed while it runs; names and kinds are checked already.
    fn on_parameters_changed(
        &mut self,
        _changed: &BTreeMap<String, Value>,
        _context: &mut Context<'_>,
    ) -> Outcome {
        Ok(())
    }

    /// Once, at the end.
    fn on_finalize(&mut self, _context: &mut Context<'_>) -> Outcome {
        Ok(())
    }
}

/// What a callback returns.
pub type Outcome = Result<(), ComponentError>;

/// Why a component cannot go on: a cause that recovery policies know, and a sentence.
///
/// Any error becomes one with the cause [`Cause::Error`], so `?` works on everything.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct ComponentError {
    fault: Fault,
}

impl ComponentError {
    /// Of that cause, with a reason for people.
    pub fn new(cause: Cause, reason: impl fmt::Display) -> Self {
        Self { fault: Fault { cause, reason: reason.to_string() } }
    }

    /// Hardware failed, or was disconnected.
    pub fn hardware_lost(reason: impl fmt::Display) -> Self {
        Self::new(Cause::HardwareLost, reason)
    }

    /// An error without a cause of its own.
    pub fn other(reason: impl fmt::Display) -> Self {
        Self::new(Cause::Error, reason)
    }
}

// Not an `Error` itself, or this conversion would overlap with that of every type to itself.
impl<E: std::error::Error> From<E> for ComponentError {
    fn from(error: E) -> Self {
        let mut reason = error.to_string();
        let mut source = error.source();
        while let Some(cause) = source {
            let words = cause.to_string();
            if !reason.contains(&words) {
                reason = format!("{reason}: {words}");
            }
            source = cause.source();
        }
        Self::other(reason)
    }
}

impl From<ComponentError> for Fault {
    fn from(error: ComponentError) -> Self {
        error.fault
    }
}

impl fmt::Display for ComponentError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}: {}", self.fault.cause, self.fault.reason)
    }
}

/// What a callback may know and wish.
#[derive(Debug)]
pub struct Context<'a> {
    pub(crate) component: &'a ComponentKey,
    pub(crate) state: LifecycleState,
    pub(crate) token: Option<&'a Token>,
    pub(crate) tick: u64,
    pub(crate) now_ns: u64,
    pub(crate) period_ns: Option<u64>,
    pub(crate) wishes: &'a mut Wishes,
}

/// What a callback wished for, seen to when it returned.
#[derive(Debug, Default)]
pub(crate) struct Wishes {
    pub(crate) fault: Option<Fault>,
    pub(crate) stop: bool,
}

impl Context<'_> {
    /// Which component this is.
    pub fn component(&self) -> &ComponentKey {
        self.component
    }

    /// Where it stands in its life.
    pub fn state(&self) -> LifecycleState {
        self.state
    }

    /// The token under which it is active.
    pub fn token(&self) -> Option<&Token> {
        self.token
    }

    /// Ticks so far; the one going on included.
    pub fn tick(&self) -> u64 {
        self.tick
    }

    /// CLOCK_MONOTONIC when the callback began, nanoseconds.
    pub fn now_ns(&self) -> u64 {
        self.now_ns
    }

    /// The period of a periodic component, nanoseconds.
    pub fn period_ns(&self) -> Option<u64> {
        self.period_ns
    }

    /// Goes to the error state when the callback returned; the first fault counts.
    pub fn raise(&mut self, cause: Cause, reason: impl fmt::Display) {
        let fault = Fault { cause, reason: reason.to_string() };
        self.wishes.fault.get_or_insert(fault);
    }

    /// Ends the process in an orderly way when the callback returned. The agent takes that
    /// for an exit and does what the recovery policy says.
    pub fn stop(&mut self) {
        self.wishes.stop = true;
    }

    /// Writes a line to the component's log.
    pub fn log(&self, line: impl fmt::Display) {
        crate::log(format_args!("{line}"));
    }
}
