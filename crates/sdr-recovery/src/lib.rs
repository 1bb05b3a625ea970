//! Conditions, ladders, and what to try next.
#![no_std]
#![forbid(unsafe_code)]

extern crate alloc;

mod condition;
mod ladder;
mod policy;
mod table_iii;

pub use condition::{Bar, Clear, Condition, Fact, Level, RSSI_MEDIAN_OVER, Unit};
pub use ladder::{Backoff, Ladder, LadderError, RUNGS_MAX, Restart, Rung};
pub use policy::{
    Limits, MEDIAN_OVER_MAX, POLICY_VERSION, Policy, PolicyError, PolicyParts, Return, Rule,
    Trigger,
};
