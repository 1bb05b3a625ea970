//! What the fuzz targets share: a counter of memory, a reader of choices, and a brain with a
//! shell that answers everything at once.

pub mod bytes;
pub mod fleet;
pub mod insider;
pub mod meter;
/// The components' protocol, without the shared memory that its crate brings along.
#[path = "../../crates/sdr-component/src/protocol/mod.rs"]
pub mod protocol;
pub mod recordings;
pub mod shell;
