//! What can be due.

use std::time::Duration;

use sdr_core::{
    input::{Input, InstanceId},
    order::Token,
    recover::Cause,
};

use super::{Fault, Weather, fetch::Transfer};

/// Something due.
#[derive(Debug)]
pub(crate) enum Due {
    Wake { robot: usize },
    Datagram { to: usize, from: usize, bytes: Vec<u8> },
    Input { robot: usize, life: u64, input: Input },
    Turn { robot: usize, life: u64, instance: InstanceId, turn: Turn },
    Stored { robot: usize, life: u64 },
    Transfer(Transfer),
    Crash { robot: usize, life: u64, down: Option<Duration> },
    Start { robot: usize },
    Sample { robot: usize, life: u64 },
    Flow { component: usize },
    Fault(Fault),
    Over(Over),
}

/// What a process does by itself or as told.
#[derive(Debug, Clone)]
pub(crate) enum Turn {
    Started,
    Idle,
    Active(Token),
    Error(Cause),
    Exit(&'static str),
    Hang,
    Seen,
}

/// The end of a fault.
#[derive(Debug, Clone)]
pub(crate) enum Over {
    Deaf(usize),
    Cut(u64),
    DiskFull(usize),
    DiskSlow(usize),
    Storm(Weather),
    Behaviour(usize, String),
    Fade(usize),
}
