//! Memory that a component holds only to be as large as the paper's.

use sdr_core::spec::Value;

use crate::component::ComponentError;
use crate::protocol::{BALLAST_BYTES_MAX, BALLAST_PARAMETER, Configure};
use crate::sys::TouchedMemory;

/// Maps and touches what the parameter asks for; `None` when that is nothing.
pub(super) fn allocate(configure: &Configure) -> Result<Option<TouchedMemory>, ComponentError> {
    let bytes = match configure.parameters.get(BALLAST_PARAMETER) {
        None | Some(Value::Int(0)) => return Ok(None),
        Some(Value::Int(bytes)) if (1..=BALLAST_BYTES_MAX).contains(bytes) => *bytes,
        Some(other) => {
            return Err(ComponentError::other(format!(
                "parameter `{BALLAST_PARAMETER}` is {other}; allowed: 0 to {BALLAST_BYTES_MAX}"
            )));
        }
    };
    let size = usize::try_from(bytes).unwrap_or(usize::MAX);
    TouchedMemory::new(size).map(Some).map_err(|error| {
        ComponentError::other(format!("cannot allocate {bytes} bytes of ballast: {error}"))
    })
}
