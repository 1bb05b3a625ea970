//! Brains of two and three robots in virtual time.

mod again;
mod deployment;
mod parts;
mod recovery;
mod role;
mod standby;
