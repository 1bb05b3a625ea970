//! What a component author uses: `trait Component`, typed ports, `run()`.

pub mod clock;
pub mod message;
pub mod port;
pub mod protocol;
pub mod shm;
#[expect(unsafe_code, reason = "descriptors, loans and ballast; each call says why it is sound")]
mod sys;
#[cfg(test)]
mod testing;
