//! Brains of two and three robots in virtual time.

mod adoption;
mod again;
mod deployment;
mod own_recovery;
mod policies;
mod power;
mod recovery;
mod role;
mod rules;
mod standby;
