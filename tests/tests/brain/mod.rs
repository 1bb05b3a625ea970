//! Brains of two and three robots in virtual time.

mod adoption;
mod again;
mod deployment;
mod group;
mod own_recovery;
mod parts;
mod policies;
mod recovery;
mod role;
mod rules;
mod standby;
