//! Brains of two and three robots in virtual time.

mod adoption;
mod again;
mod deployment;
mod policies;
mod recovery;
mod role;
mod standby;
