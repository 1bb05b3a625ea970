//! All tests over the whole house, in one binary.

mod brain;
mod e2e;
mod tidy;
