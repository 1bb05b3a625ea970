//! Ways to place components on robots.
//!
//! Given robots, each with some memory, CPU and charge left, and components that need some of
//! it, find a home for every component so that no robot falls under its bars (the paper's
//! Table I) and no two components talk over a link that is worse than its bars (Table II).
//! For each robot `r`, with the components placed there:
//!
//! ```text
//!   memory_free(r) - sum of memory(c) over c on r  >=  bar
//! ```
//!
//! and in the same way for CPU. All bars are judged *after* placing.
//!
//! ```text
//!  Problem ──▶ facts ──▶ attempt ──▶ outcome ──▶ Plan
//!  (policy)    known,    bundle by   the first    homes, and a
//!              assumed   bundle on   attempt that number and a bar
//!                        the board   is whole     for every "no"
//! ```
//!
//! Two ways to choose among robots that fit: [`FirstFit`] takes the first of a list,
//! [`BestScore`] the one with the greatest weighted score. Both place components in the order
//! of the file; when that leaves one homeless, they also try the largest and the smallest
//! first, and keep the attempt that places most.
//!
//! In recovery ([`sdr_core::allocate::Tier::Relaxed`]) components that talk to each other go to
//! one robot when one can take them, so that the stream between them stays off the radio; the
//! strict bars are tried for all of them before the relaxed ones are tried for all of them.
//!
//! Equal problems give equal plans on every robot, whatever the order of the robots in them;
//! [`conformance`] checks that, and all other promises, for any allocator.
//!
//! ```
//! use sdr_alloc::{Bars, Policy, Strategy, allocate};
//! use sdr_core::{
//!     allocate::{Item, Problem, RobotOffer, Tier},
//!     id::{ComponentKey, Name, RobotId},
//!     spec::{Needs, Place},
//!     units::{Bytes, Permille},
//! };
//!
//! let name = |word| Name::new(word).unwrap();
//! let robot = |word| RobotOffer {
//!     robot: RobotId::new(word).unwrap(),
//!     memory_free: Bytes::mega(900),
//!     cpu_capacity: Permille(4000),
//!     cpu_free: Permille(4000),
//!     battery: None,
//!     rssi: None,
//!     position: None,
//!     labels: vec![],
//!     devices: vec![],
//!     launchables: vec![7],
//! };
//! let item = |word| Item {
//!     component: ComponentKey::new(&name("mapping"), &name(word)),
//!     needs: Needs { memory: Bytes::mega(500), cpu: Permille(200) },
//!     launch: 7,
//!     devices: vec![],
//!     place: Place::default(),
//!     running_on: vec![],
//!     avoid: vec![],
//! };
//! let bars = Bars { memory_free_at_least: Some(Bytes::mega(300)), ..Bars::none() };
//! let policy = Policy { strategy: Strategy::FirstFit, strict: bars, ..Policy::default() };
//!
//! let plan = allocate(&Problem {
//!     tier: Tier::Strict,
//!     policy: policy.encode(),
//!     receiver: RobotId::new("robot-1").unwrap(),
//!     robots: vec![robot("robot-1"), robot("robot-2")],
//!     items: vec![item("camera"), item("mapper"), item("planner")],
//!     settled: vec![],
//!     connections: vec![],
//!     pairs: vec![],
//! })
//! .unwrap();
//!
//! assert_eq!(plan.placements[0].robot.as_str(), "robot-1");
//! assert_eq!(plan.placements[1].robot.as_str(), "robot-2");
//! let why = plan.homeless[0].refusals[0].to_string();
//! assert_eq!(why, "robot-1: memory_free -100 MB, bar 300 MB");
//! ```
#![no_std]
#![forbid(unsafe_code)]

extern crate alloc;

mod policy;

mod attempt;
mod board;
mod explain;
mod facts;
mod feasible;
mod outcome;
mod score;

mod best_score;
mod first_fit;

pub mod conformance;

pub use best_score::BestScore;
pub use explain::{homeless_line, placement_line};
pub use first_fit::FirstFit;
pub use outcome::{allocate, check};
pub use policy::{
    Bars, BatteryBar, IfUnknown, Millimetres, POLICY_VERSION, Policy, PolicyError, StartWith,
    Strategy, Unknown, Weight, Weights,
};
