//! Real agents and real processes, as a user runs them.

mod addresses;
mod by_hand;
mod demo;
mod five;
mod garbage;
mod keys;
mod lab;
mod life;
mod limits;
mod parts;
mod role;
mod standby;
mod strangers;
