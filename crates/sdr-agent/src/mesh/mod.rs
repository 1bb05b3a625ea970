//! The robot's ear and mouth for other robots.

pub(crate) mod keys;
pub(crate) mod sealed;
pub(crate) mod udp;
pub(crate) mod watch;
