//! The rules of the house that a machine can read: what may depend on what, how long a file
//! may be, and that the documents tell the truth.

mod arrows;
mod documents;
mod licences;
mod sources;
mod spdx;
mod tree;
