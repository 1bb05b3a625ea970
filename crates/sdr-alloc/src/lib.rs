//! Ways to place components on robots.
#![no_std]
#![forbid(unsafe_code)]

extern crate alloc;

mod policy;

pub use policy::{
    Bars, BatteryBar, IfUnknown, Millimetres, POLICY_VERSION, Policy, PolicyError, StartWith,
    Strategy, Unknown, Weight, Weights,
};
