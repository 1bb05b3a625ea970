//! Brains of two and three robots in virtual time.

mod deployment;
mod recovery;
mod role;
mod standby;
