//! Where the rover is: wheels and gyro carry the estimate, landmarks correct it.

mod filter;
mod localizer;
mod locate;
mod odometer;

pub use filter::{Correction, Estimator, Observation, Spread};
pub use localizer::Localizer;
pub use locate::locate;
pub use odometer::{DeadReckoning, Motion, Odometer};

#[cfg(test)]
mod tests;
