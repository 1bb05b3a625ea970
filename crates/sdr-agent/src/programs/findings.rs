//! What a program answers: `{"causes": [{"component": .., "cause": .., "reason": ..}]}`.

use sdr_core::{id::Name, input::Finding, recover::Cause};
use serde::Deserialize;

/// Most causes of one answer.
const FINDINGS_MAX: usize = 256;

#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
struct Answer {
    causes: Vec<Found>,
}

#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
struct Found {
    component: Name,
    /// May be left out by a program that finds one cause only.
    cause: Option<Cause>,
    #[serde(default)]
    reason: String,
}

/// The findings in an answer; the error says what is wrong with it.
pub(super) fn read(bytes: &[u8]) -> Result<Vec<Finding>, String> {
    let answer: Answer = serde_json::from_slice(bytes)
        .map_err(|error| format!("answers no {{\"causes\": [..]}}: {error}"))?;
    if answer.causes.len() > FINDINGS_MAX {
        return Err(format!("finds {} causes; at most {FINDINGS_MAX}", answer.causes.len()));
    }
    let finding = |found: Found| Finding {
        component: found.component,
        cause: found.cause,
        reason: found.reason,
    };
    Ok(answer.causes.into_iter().map(finding).collect())
}
