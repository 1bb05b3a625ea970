//! Whom a certificate is for.

use std::fmt;

use ring::digest;
use sdr_core::id::RobotId;

use crate::hex;

/// An operator's name: written like a robot's.
pub type OperatorId = RobotId;

/// What an operator may do with a robot's API.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Role {
    /// Look at everything, change nothing.
    View,
    /// Also deploy, undeploy and bring keys.
    Operate,
}

impl Role {
    /// `view` or `operate`.
    pub fn word(self) -> &'static str {
        match self {
            Self::View => "view",
            Self::Operate => "operate",
        }
    }

    /// The role of that word.
    pub fn of_word(word: &str) -> Option<Self> {
        [Self::View, Self::Operate].into_iter().find(|role| role.word() == word)
    }
}

/// Whom a certificate is for. As text `robot/NAME`, `view/NAME` or `operate/NAME`.
#[derive(Clone, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Holder {
    /// A robot of the fleet.
    Robot(RobotId),
    /// A person or program that talks to robots.
    Operator {
        /// Its name.
        name: OperatorId,
        /// What it may do.
        role: Role,
    },
}

impl Holder {
    /// Reads `robot/NAME`, `view/NAME` or `operate/NAME`.
    pub fn parse(text: &str) -> Option<Self> {
        let (kind, name) = text.split_once('/')?;
        let name = RobotId::new(name).ok()?;
        match Role::of_word(kind) {
            Some(role) => Some(Self::Operator { name, role }),
            None => (kind == "robot").then_some(Self::Robot(name)),
        }
    }

    /// Its name without its kind.
    pub fn name(&self) -> &RobotId {
        match self {
            Self::Robot(name) | Self::Operator { name, .. } => name,
        }
    }

    /// The name that stands in a certificate of `fleet`.
    pub fn uri(&self, fleet: &str) -> String {
        format!("sdr://{fleet}/{self}")
    }

    /// Fleet and holder of a name in a certificate.
    pub fn of_uri(uri: &str) -> Option<(String, Self)> {
        let (fleet, holder) = uri.strip_prefix("sdr://")?.split_once('/')?;
        Some((RobotId::new(fleet).ok()?.to_string(), Self::parse(holder)?))
    }
}

impl fmt::Display for Holder {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Robot(name) => write!(f, "robot/{name}"),
            Self::Operator { name, role } => write!(f, "{}/{name}", role.word()),
        }
    }
}

/// Names one certificate: the SHA-256 of its bytes.
#[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct Fingerprint([u8; 32]);

impl Fingerprint {
    /// Of a certificate in DER.
    pub fn of(certificate: &[u8]) -> Self {
        let digest = digest::digest(&digest::SHA256, certificate);
        Self(digest.as_ref().try_into().expect("SHA-256 has 32 bytes"))
    }

    /// Reads 64 lower-case hexadecimal digits.
    pub fn parse(text: &str) -> Option<Self> {
        hex::decode(text).map(Self)
    }
}

impl fmt::Display for Fingerprint {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&hex::encode(&self.0))
    }
}

impl fmt::Debug for Fingerprint {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "Fingerprint({self})")
    }
}

/// Who showed which certificate.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Bearer {
    /// Its fleet.
    pub fleet: String,
    /// Whom the certificate is for.
    pub holder: Holder,
    /// Which certificate.
    pub fingerprint: Fingerprint,
}

impl fmt::Display for Bearer {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}", self.holder)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_holder_is_read_back_from_its_name_in_a_certificate() {
        for text in ["robot/robot-1", "view/anna", "operate/ops_2"] {
            let holder = Holder::parse(text).unwrap();
            assert_eq!(holder.to_string(), text);
            assert_eq!(Holder::of_uri(&holder.uri("moon")), Some(("moon".into(), holder)));
        }
        for wrong in ["", "robot", "robot/", "root/anna", "robot/a/b", "robot/A", "view/a b"] {
            assert_eq!(Holder::parse(wrong), None, "{wrong}");
        }
        for wrong in ["http://moon/robot/a", "sdr://moon", "sdr:///robot/a", "sdr://Moon/robot/a"] {
            assert_eq!(Holder::of_uri(wrong), None, "{wrong}");
        }
    }
}
