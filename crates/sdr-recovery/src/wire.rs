//! A policy as systems carry it: small enough for one record of the fleet.

use alloc::{string::String, vec::Vec};

use sdr_core::{recover::Cause, spec::PolicyBytes};
use serde::{Deserialize, Serialize};

use crate::{
    ladder::Ladder,
    policy::{Exception, Limits, Policy, PolicyParts, Rule, Trigger},
    policy_error::PolicyError,
};

/// First byte of an encoded policy; raised when fields change.
pub const POLICY_VERSION: u8 = 4;

#[derive(Serialize, Deserialize)]
struct Wire {
    name: String,
    ladders: Vec<(String, Ladder)>,
    rules: Vec<WireRule>,
    /// `None`: as built in.
    limits: Option<Limits>,
    exceptions: Vec<WireException>,
}

#[derive(Serialize, Deserialize)]
struct WireRule {
    cause: Cause,
    trigger: Trigger,
    ladder: u8,
    actuator: Option<u8>,
}

#[derive(Serialize, Deserialize)]
struct WireException {
    component: String,
    rules: Vec<WireRule>,
    without: Vec<Cause>,
    limits: Option<Limits>,
}

impl Policy {
    /// The policy in `policy`; empty bytes mean [`Policy::default`].
    pub fn decode(policy: &PolicyBytes) -> Result<Self, PolicyError> {
        let Some((version, rest)) = policy.bytes.split_first() else {
            return Ok(Self::default());
        };
        if *version != POLICY_VERSION {
            return Err(PolicyError::Version { found: *version });
        }
        let wire: Wire = postcard::from_bytes(rest).map_err(|_| PolicyError::Unreadable)?;
        Self::new(wire.parts()?)
    }

    /// The policy as systems carry it: a version byte, then postcard.
    pub fn encode(&self) -> PolicyBytes {
        let parts = self.parts();
        let wire = Wire {
            name: parts.name.clone(),
            ladders: parts.ladders.clone(),
            rules: rules_to_wire(&parts.rules, &parts.ladders),
            limits: (parts.limits != Limits::default()).then_some(parts.limits),
            exceptions: parts
                .exceptions
                .iter()
                .map(|exception| WireException {
                    component: exception.component.clone(),
                    rules: rules_to_wire(&exception.rules, &parts.ladders),
                    without: exception.without.clone(),
                    limits: exception.limits,
                })
                .collect(),
        };
        let mut bytes = alloc::vec![POLICY_VERSION];
        bytes.extend(
            postcard::to_allocvec(&wire).expect("writing plain data to memory cannot fail"),
        );
        PolicyBytes { name: parts.name.clone(), bytes }
    }
}

impl Wire {
    fn parts(self) -> Result<PolicyParts, PolicyError> {
        let ladders = &self.ladders;
        let exceptions = self.exceptions.into_iter().map(|exception| {
            Ok(Exception {
                component: exception.component,
                rules: rules_from_wire(exception.rules, ladders)?,
                without: exception.without,
                limits: exception.limits,
            })
        });
        Ok(PolicyParts {
            name: self.name,
            rules: rules_from_wire(self.rules, ladders)?,
            limits: self.limits.unwrap_or_default(),
            exceptions: exceptions.collect::<Result<_, PolicyError>>()?,
            ladders: self.ladders,
        })
    }
}

fn rules_to_wire(rules: &[Rule], ladders: &[(String, Ladder)]) -> Vec<WireRule> {
    let number = |name: &String| {
        let found = ladders.iter().position(|(other, _)| other == name);
        let found = found.expect("a checked policy has the ladders that its rules name");
        u8::try_from(found).expect("a checked policy has few ladders")
    };
    let rule = |rule: &Rule| WireRule {
        cause: rule.cause,
        trigger: rule.trigger.clone(),
        ladder: number(&rule.ladder),
        actuator: rule.actuator.as_ref().map(number),
    };
    rules.iter().map(rule).collect()
}

fn rules_from_wire(
    rules: Vec<WireRule>,
    ladders: &[(String, Ladder)],
) -> Result<Vec<Rule>, PolicyError> {
    let name = |number: u8| {
        let found = ladders.get(usize::from(number)).map(|(name, _)| name.clone());
        found.ok_or(PolicyError::Unreadable)
    };
    let rule = |rule: WireRule| {
        Ok(Rule {
            cause: rule.cause,
            trigger: rule.trigger,
            ladder: name(rule.ladder)?,
            actuator: rule.actuator.map(name).transpose()?,
        })
    };
    rules.into_iter().map(rule).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_policy_survives_the_wire_and_leaves_room_in_its_record() {
        let policy = Policy::default();
        let encoded = policy.encode();

        assert!(encoded.bytes.len() < 400, "{} bytes", encoded.bytes.len());
        assert_eq!(Policy::decode(&encoded), Ok(policy));
        assert_eq!(Policy::decode(&PolicyBytes::default()), Ok(Policy::default()));
    }

    #[test]
    fn broken_and_later_bytes_are_refused() {
        let mut bytes = Policy::default().encode();
        bytes.bytes[0] = 7;
        assert_eq!(Policy::decode(&bytes), Err(PolicyError::Version { found: 7 }));

        bytes.bytes[0] = POLICY_VERSION;
        bytes.bytes.truncate(40);
        assert_eq!(Policy::decode(&bytes), Err(PolicyError::Unreadable));
    }
}
