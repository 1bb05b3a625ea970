//! What happened, for operators, recordings and reports. The list of kinds with their
//! numbers is `docs/events.md`, a contract.

use alloc::{collections::BTreeMap, string::String};

use serde::{Deserialize, Serialize};

use crate::{
    id::{Name, RobotId},
    order::Token,
};

/// One thing that happened or was decided on one robot.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Event {
    /// One of the words in `docs/events.md`, such as `placed`, `active`, `condition-raised`.
    pub kind: String,
    /// The robot that says it.
    pub robot: RobotId,
    /// The system concerned.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub system: Option<Name>,
    /// The component concerned.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub component: Option<Name>,
    /// Epoch and run concerned.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub token: Option<Token>,
    /// Why, in a sentence with numbers.
    pub reason: String,
    /// Figures, the unit ending the name: `held_ms`, `memory_left_bytes`.
    #[serde(default, skip_serializing_if = "BTreeMap::is_empty")]
    pub numbers: BTreeMap<String, f64>,
}

impl Event {
    /// A bare event of `kind` on `robot`.
    pub fn new(kind: &str, robot: &RobotId, reason: impl Into<String>) -> Self {
        Self {
            kind: kind.into(),
            robot: robot.clone(),
            system: None,
            component: None,
            token: None,
            reason: reason.into(),
            numbers: BTreeMap::new(),
        }
    }

    /// About this component.
    #[must_use]
    pub fn about(mut self, component: &crate::id::ComponentKey) -> Self {
        self.system = Some(component.system.clone());
        self.component = Some(component.name.clone());
        self
    }

    /// Under this token.
    #[must_use]
    pub fn under(mut self, token: &Token) -> Self {
        self.token = Some(token.clone());
        self
    }

    /// With this figure.
    #[must_use]
    pub fn number(mut self, name: &str, value: f64) -> Self {
        self.numbers.insert(name.into(), value);
        self
    }
}
