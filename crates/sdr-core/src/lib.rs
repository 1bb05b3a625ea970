//! The pure core of sdr-agent: what a fleet of robots knows, and what it decides.
//!
//! ```text
//!  reports, outcomes, datagrams, deployments
//!        │ Input
//!        ▼
//!   ┌─────────┐  records  ┌────────┐  beliefs  ┌──────────────────────────┐
//!   │  mesh   │──────────▶│  view  │──────────▶│ brain                    │
//!   │ tables  │           └────────┘           │  decide  (coordinator)   │
//!   └─────────┘◀── assignments, reports ───────│  reconcile (every robot) │
//!        │                                     │  local   (own ladder)    │
//!        ▼ datagrams                           └──────────────────────────┘
//!                                                   │ Effect
//!                                                   ▼ to the shell
//! ```
//!
//! No I/O, no clock, no threads, no unseeded chance: time and randomness are given by the
//! caller, effects are carried out by the caller, and what came of them returns as the next
//! [`input::Input`]. Same inputs, same order, same seed: same effects, byte for byte.
//!
//! Modules, in the order data flows through them: the smallest nouns ([`time`], [`units`],
//! [`id`], [`order`]), the life cycle, what should run ([`spec`]), what a robot says of itself
//! ([`report`]), what the fleet agrees on ([`record`]), how both are spread (`mesh`), what is
//! believed (`view`), the seams for policies ([`allocate`], [`recover`]), and the `brain`.
#![no_std]
#![forbid(unsafe_code)]

extern crate alloc;

pub mod id;
pub mod lifecycle;
pub mod mesh;
pub mod order;
pub mod planted;
pub mod rng;
pub mod time;
pub mod units;

pub mod blob;
pub mod record;
pub mod report;
pub mod spec;

pub mod allocate;
mod cause;
pub mod event;
pub mod fitness;
pub mod recover;

pub mod brain;
pub mod disk;
pub mod effect;
pub mod input;

pub mod api;
pub mod recording;
