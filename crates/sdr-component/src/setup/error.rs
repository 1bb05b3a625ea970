//! Why a component cannot be set up.

use sdr_core::{id::NameError, spec::Value};
use thiserror::Error;

use crate::shm::ShmError;

/// A declaration and a configuration do not fit. Nothing runs; mended by whoever wrote the
/// system file, or the component.
#[derive(Clone, Debug, PartialEq, Eq, Error)]
#[non_exhaustive]
pub enum SetupError {
    /// A port's name.
    #[error(transparent)]
    Name(#[from] NameError),
    /// Shared memory refused.
    #[error(transparent)]
    Memory(#[from] ShmError),
    /// The component's author declared something twice.
    #[error("{what} `{name}` is declared twice")]
    DeclaredTwice {
        /// Port or parameter.
        what: &'static str,
        /// Its name.
        name: String,
    },
    /// A value of another kind.
    #[error("parameter `{name}` is {found} ({kind}); allowed: {allowed}")]
    ParameterKind {
        /// The parameter.
        name: String,
        /// As given.
        found: Value,
        /// Its kind.
        kind: &'static str,
        /// The kind of the default.
        allowed: &'static str,
    },
    /// A value outside its range.
    #[error("parameter `{name}` is {found}; allowed: {from} to {to}")]
    ParameterRange {
        /// The parameter.
        name: String,
        /// As given.
        found: String,
        /// Least allowed.
        from: String,
        /// Greatest allowed.
        to: String,
    },
    /// A parameter that the component does not have.
    #[error("parameter `{name}` is unknown; there are: {known}")]
    UnknownParameter {
        /// As given.
        name: String,
        /// All there are.
        known: String,
    },
    /// A connection into a port that the component does not have.
    #[error("input `{name}` is unknown; there are: {known}")]
    UnknownInput {
        /// As given.
        name: String,
        /// All there are.
        known: String,
    },
    /// A connection that carries another type.
    #[error("input `{port}` is fed by {path} with {found}; it reads {allowed}")]
    WrongType {
        /// The input.
        port: String,
        /// The output.
        path: String,
        /// What comes.
        found: String,
        /// What can be read.
        allowed: &'static str,
    },
    /// The robot does not have it, or the system file does not ask for it.
    #[error("device `{name}` was not given; there are: {known}")]
    NoDevice {
        /// The device.
        name: String,
        /// All there are.
        known: String,
    },
}
