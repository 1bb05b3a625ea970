//! Processes that pretend.

use std::{collections::BTreeMap, time::Duration};

use sdr_core::{
    effect::InputWiring, id::ComponentKey, lifecycle::LifecycleState, order::Token, recover::Cause,
    spec::ComponentSpec,
};

/// How processes of one component behave on one robot from now on.
#[derive(Clone, Debug, PartialEq, Eq)]
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
pub struct Process {
    /// Of which component.
    pub component: ComponentKey,
    /// Its component's number.
    pub(crate) number: usize,
    /// What it was started with.
    pub(crate) spec: ComponentSpec,
    /// Its execution thread does nothing any more.
    pub(crate) hung: bool,
    /// Its inputs, each with the number of the component that feeds it.
    pub(crate) inputs: Vec<(InputWiring, usize)>,
    /// Its state.
    pub state: LifecycleState,
    /// What it works under, when active.
    pub token: Option<Token>,
    /// The greatest token each connection accepted.
    pub heard: BTreeMap<u16, Token>,
    /// Samples its fence refused.
    pub fenced: u64,
}

impl Process {
    /// Offers a sample to the fence of one input: what is older than the last one is refused.
    /// Tells whether it carries a greater token than any before.
    pub(crate) fn offer(&mut self, connection: u16, token: &Token) -> Offered {
        match self.heard.get(&connection) {
            Some(before) if before > token => {
                self.fenced += 1;
                Offered::Refused
            }
            Some(before) if before == token => Offered::Known,
            Some(_) | None => {
                self.heard.insert(connection, token.clone());
                Offered::Switched
            }
        }
    }
}

/// What a fence made of a sample.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Offered {
    /// It is older than what was accepted.
    Refused,
    /// It is of the same activation as the last one.
    Known,
    /// It is of a newer one.
    Switched,
}
