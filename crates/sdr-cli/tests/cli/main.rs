//! The built `sdr` against an agent with canned answers: exit codes, stdout, stderr.
#![cfg(test)]

mod agent;
mod sdr;

mod asking;
mod files;
mod role;
mod waiting;
