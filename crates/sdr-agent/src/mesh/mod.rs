//! The robot's ear and mouth for other robots.

mod addresses;
pub(crate) mod discovery;
pub(crate) mod keys;
pub(crate) mod sealed;
pub(crate) mod udp;
pub(crate) mod watch;
