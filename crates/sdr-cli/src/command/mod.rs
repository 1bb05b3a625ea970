//! One file a command: its arguments and what it does.

pub(crate) mod completions;
pub(crate) mod deploy;
pub(crate) mod events;
pub(crate) mod keys;
pub(crate) mod logs;
pub(crate) mod policy;
pub(crate) mod reset;
pub(crate) mod role;
pub(crate) mod sim;
pub(crate) mod status;
pub(crate) mod stop;
pub(crate) mod undeploy;
pub(crate) mod validate;

mod await_system;
mod awaited;
mod describe;
mod duration;
mod last_words;
pub(crate) mod problems;
mod role_move;
