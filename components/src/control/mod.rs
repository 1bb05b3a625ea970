//! Drives along a path and stops on order.

mod area;
mod controller;
mod path;

pub use area::{Area, AreaError};
pub use controller::{Controller, Order, Progress, Settings, SettingsError, Verdict};
pub use path::{After, Guide, GuideSettings, Path, PathError};
