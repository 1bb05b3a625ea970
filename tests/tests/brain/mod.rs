//! Brains of two and three robots in virtual time.

mod again;
mod deployment;
mod policies;
mod power;
mod recovery;
mod role;
mod standby;
