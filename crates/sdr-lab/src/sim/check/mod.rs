//! The rules, one file each.

mod bounds;
mod coordinators;
mod deployments;
mod heals;
mod homeless;
mod leases;
mod orders;
mod scramble;
mod tokens;
mod tombs;

pub mod convergence;

pub use bounds::Bounds;
pub use coordinators::Coordinators;
pub use deployments::Deployments;
pub use heals::Heals;
pub use homeless::Homeless;
pub use leases::Leases;
pub use orders::Orders;
pub use scramble::Scramble;
pub use tokens::Tokens;
pub use tombs::Tombs;

use super::Checker;

/// All checkers that watch from the beginning.
pub(crate) fn all() -> Vec<Box<dyn Checker>> {
    vec![
        Box::<Tokens>::default(),
        Box::<Orders>::default(),
        Box::<Homeless>::default(),
        Box::<Leases>::default(),
        Box::<Coordinators>::default(),
        Box::<Scramble>::default(),
        Box::<Heals>::default(),
        Box::<Deployments>::default(),
        Box::<Tombs>::default(),
        Box::<Bounds>::default(),
    ]
}
