//! Views of the API as lines of text: pure functions, at most as wide as they are told.

pub(crate) mod event;
pub(crate) mod problems;
pub(crate) mod progress;
pub(crate) mod role;
pub(crate) mod status;
pub(crate) mod table;
pub(crate) mod units;

#[cfg(test)]
pub(crate) mod fixture;
