//! Taking certificates back.

use sdr_core::id::RobotId;

use super::{Authority, sign};
use crate::{
    folder::KeysError,
    holder::{Holder, Role},
    mesh_key::KeyId,
    statement::Denial,
};

/// A certificate that counts no more, and what came with that.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Revoked {
    /// Whose it was.
    pub holder: Holder,
    /// The number of its denial.
    pub denial: u32,
    /// The new mesh key; `None` when it was revoked before.
    pub rotated_to: Option<KeyId>,
}

impl Authority {
    /// Denies the certificate of `NAME`, `robot/NAME` or `operator/NAME` and makes a new
    /// mesh key, which the denied never learns. Twice is as once.
    pub fn revoke(&mut self, word: &str) -> Result<Revoked, KeysError> {
        let holder = self.find(word)?;
        let issued = self.issued(&holder)?.expect("it was found");
        if let Some(denial) = issued.denial {
            return Ok(Revoked { holder: issued.holder, denial, rotated_to: None });
        }
        let mut denied = self.papers.denied().clone();
        let number = u32::try_from(denied.len()).expect("denials are bounded") + 1;
        let denial = Denial {
            fleet: self.fleet().into(),
            number,
            certificate: issued.fingerprint,
            holder: issued.holder.clone(),
        };
        let line = sign::line(&denial, &self.key);
        let denial = self.trust.read_denial(&line).expect("it was signed just now");
        if !denied.add(denial) {
            return Err(KeysError::Name(format!(
                "{holder}: {} certificates were revoked, no more fit; make a new authority",
                denied.len()
            )));
        }
        let rotated_to = Some(self.renew(denied)?);
        Ok(Revoked { holder: issued.holder, denial: number, rotated_to })
    }

    /// Whom a word means.
    fn find(&self, word: &str) -> Result<Holder, KeysError> {
        let (kind, name) = word.split_once('/').map_or((None, word), |(k, n)| (Some(k), n));
        let name = RobotId::new(name).map_err(|error| KeysError::Name(error.to_string()))?;
        let robot = Holder::Robot(name.clone());
        let operator = Holder::Operator { name: name.clone(), role: Role::View };
        let wanted = match kind {
            None => vec![robot, operator],
            Some("robot") => vec![robot],
            Some("operator" | "view" | "operate") => vec![operator],
            Some(other) => {
                let allowed = "allowed: NAME, robot/NAME, operator/NAME";
                return Err(KeysError::Name(format!("`{other}/` is no kind of key; {allowed}")));
            }
        };
        let mut found = Vec::new();
        for holder in wanted {
            if self.issued(&holder)?.is_some() {
                found.push(holder);
            }
        }
        match found.as_slice() {
            [only] => Ok(only.clone()),
            [] => Err(KeysError::Name(format!(
                "no certificate of `{word}` was made here; `sdr keys show` lists them"
            ))),
            _ => Err(KeysError::Name(format!(
                "`{word}` is a robot and an operator; say robot/{name} or operator/{name}"
            ))),
        }
    }
}
