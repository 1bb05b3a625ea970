//! All tests over the whole house, in one binary.
#![expect(clippy::unwrap_used, reason = "a test ends at the first surprise, helpers included")]

mod brain;
mod e2e;
mod golden;
mod sim;
mod tidy;
