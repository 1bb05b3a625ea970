//! Whole fleets in virtual time, under everything that can go wrong.

mod checkers;
mod histories;
mod seeds;
mod tombstones;
