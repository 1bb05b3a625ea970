//! The harness of the tests over the whole house.
//!
//! [`fleet`]: brains of several robots in virtual time, joined by a wire that may lose and
//! split, with processes that only pretend. [`systems`]: systems to deploy on them.

pub mod fleet;
pub mod systems;
