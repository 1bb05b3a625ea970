//! What the paper's five components think, as plain functions on plain types; and [`faulty`], which
//! misbehaves on order.
//!
//! ```text
//! fisheye -> anomaly (vision: red box) ---- danger ----+
//!                                                      v
//! camera -> position (vision: landmarks; estimate) -> controller (control) -> wheels
//!                ^                                                              |
//!                +------------------------ motion (estimate: odometer) ---------+
//! ```
//!
//! [`programs`] joins these to ports and devices; the executables in `src/bin` only run them.

pub mod control;
pub mod estimate;
pub mod faulty;
pub mod programs;
pub mod vision;
