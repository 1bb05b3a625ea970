//! One record of an author, and what it is about.

use alloc::{format, string::String, sync::Arc, vec::Vec};

use super::commons::Commons;
use crate::{
    id::{ComponentKey, Name, RobotId},
    recover::Cause,
    report::Report,
};

/// Longest key of a record: a word, a component's key and a cause.
pub(super) const KEY_BYTES_MAX: usize = 140;

/// Names one record of an author.
#[derive(Clone, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct AuthorKey(String);

impl AuthorKey {
    /// The key as it came.
    pub(super) fn said(key: String) -> Self {
        Self(key)
    }

    /// The key as it travels.
    pub(super) fn as_str(&self) -> &str {
        &self.0
    }

    /// The key of an instance's report.
    pub fn instance(component: &ComponentKey) -> Self {
        Self(format!("i/{component}"))
    }

    /// The key of a condition.
    pub fn condition(system: &Name, cause: Cause) -> Self {
        Self(format!("c/{system}/{cause}"))
    }

    /// The key of what the coordinator says of a component without a home.
    pub fn homeless(component: &ComponentKey) -> Self {
        Self(format!("n/{component}"))
    }

    /// The key of what the coordinator says of its successors.
    pub fn succession() -> Self {
        Self(String::from("s"))
    }

    /// The key of what a robot says of its disk.
    pub fn stored() -> Self {
        Self(String::from("d"))
    }

    /// The key of what was measured of the link to `robot`.
    pub fn link(robot: &RobotId) -> Self {
        Self(format!("l/{robot}"))
    }

    pub(super) fn of(report: &Report) -> Self {
        match report {
            Report::Facts(_) => Self(String::from("f")),
            Report::Host(_) => Self(String::from("h")),
            Report::Link(robot, _) => Self::link(robot),
            Report::Instance(instance) => Self::instance(&instance.component),
            Report::Condition(condition) => Self::condition(&condition.system, condition.cause),
            Report::Succession(_) => Self::succession(),
            Report::Homeless(homeless) => Self::homeless(&homeless.component),
            Report::Stored(_) => Self::stored(),
        }
    }
}

/// One record of an author: read, and never changed, so that whoever holds it shares it.
#[derive(Debug, PartialEq)]
pub struct Saying {
    key: AuthorKey,
    /// Empty when it is taken back.
    value: Vec<u8>,
    /// `None` for a record taken back, or of a later version.
    report: Option<Report>,
}

impl Saying {
    /// A record of this robot itself.
    pub(super) fn of(key: AuthorKey, value: Vec<u8>, report: &Report) -> Arc<Self> {
        Arc::new(Self { key, value, report: Some(report.clone()) })
    }

    /// The record of `value` under `key`.
    pub(super) fn read(key: AuthorKey, value: Vec<u8>) -> Arc<Self> {
        let report = postcard::take_from_bytes(&value).ok().map(|(report, _later)| report);
        Arc::new(Self { key, value, report })
    }

    /// What it is about.
    pub fn key(&self) -> &AuthorKey {
        &self.key
    }

    /// As it travels.
    pub fn value(&self) -> &[u8] {
        &self.value
    }

    /// What it says, as far as that can be read.
    pub(super) fn report(&self) -> Option<&Report> {
        self.report.as_ref()
    }
}

/// What new records of an author are about, as far as others act on it at once.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Spoken {
    /// Its body and limits.
    pub facts: bool,
    /// Its trouble.
    pub conditions: bool,
    /// Its instances of these components.
    pub components: Vec<ComponentKey>,
}

impl Spoken {
    pub(super) fn note(&mut self, saying: &Saying) {
        match &saying.report {
            Some(Report::Facts(_)) => self.facts = true,
            Some(Report::Instance(instance)) => self.components.push(instance.component.clone()),
            Some(Report::Condition(_)) => self.conditions = true,
            Some(
                Report::Host(_)
                | Report::Link(..)
                | Report::Succession(_)
                | Report::Homeless(_)
                | Report::Stored(_),
            )
            | None => {}
        }
    }
}

/// The record of `value` under `key`, as somebody holds it already, or anew.
pub(super) fn shared(key: AuthorKey, value: Vec<u8>, commons: Option<&dyn Commons>) -> Arc<Saying> {
    if let Some(saying) = commons.and_then(|commons| commons.saying(&key, &value)) {
        return saying;
    }
    let saying = Saying::read(key, value);
    if let Some(commons) = commons {
        commons.keep_saying(&saying);
    }
    saying
}
