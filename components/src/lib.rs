//! What the paper's five components think, as plain functions on plain types.
//!
//! ```text
//! fisheye -> anomaly (vision: red box) ---- danger ----+
//!                                                      v
//! camera -> position (vision: landmarks; estimate) -> controller (control) -> wheels
//!                ^                                                              |
//!                +------------------------ motion (estimate: odometer) ---------+
//! ```
//!
//! The programs in `src/bin` join these to ports and devices.

pub mod control;
pub mod estimate;
pub mod vision;
