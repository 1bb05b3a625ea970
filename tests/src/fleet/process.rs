//! Processes that pretend.

use std::{collections::BTreeMap, time::Duration};

use sdr_core::{
    effect::InputWiring, id::ComponentKey, lifecycle::LifecycleState, order::Token, recover::Cause,
};

/// How processes of one component behave from now on.
#[derive(Clone, Debug)]
pub struct Behaviour {
    /// From the start to Inactive.
    pub initialise: Duration,
    /// Ends by itself so long after it became active.
    pub crash_after: Option<Duration>,
    /// Goes to Error with this cause so long after it became active.
    pub fail_after: Option<(Duration, Cause)>,
    /// Cannot be started at all.
    pub unstartable: bool,
}

impl Default for Behaviour {
    fn default() -> Self {
        Self {
            initialise: Duration::from_millis(80),
            crash_after: None,
            fail_after: None,
            unstartable: false,
        }
    }
}

/// One process.
#[derive(Clone, Debug)]
pub(super) struct Process {
    pub(super) component: ComponentKey,
    pub(super) inputs: Vec<InputWiring>,
    pub(super) state: LifecycleState,
    pub(super) token: Option<Token>,
    pub(super) heard: BTreeMap<u16, Token>,
    /// Samples refused by its fence, per connection.
    pub(super) fenced: u64,
}

/// A process that sends: where, what, under which token.
#[derive(Clone, Debug)]
pub(super) struct Output {
    pub(super) robot: usize,
    pub(super) component: ComponentKey,
    pub(super) token: Token,
    /// Paths it forwards to other robots, with the token allowed.
    pub(super) forwards: Vec<(String, Option<Token>)>,
}
