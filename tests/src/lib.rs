//! The harness of the tests over the whole house.
//!
//! [`fleet`]: brains of several robots in virtual time, joined by a wire that may lose and
//! split, with processes that only pretend. [`house`]: real agents and components on
//! loopback. [`systems`]: systems to deploy on the former.

pub mod fleet;
pub mod house;
pub mod systems;
