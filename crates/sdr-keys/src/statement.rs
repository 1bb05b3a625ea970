//! What the authority says to the whole fleet: one signed line of text each.
//!
//! ```text
//! sdr1 keys fleet=moon key=4 check=<32 hex> denied=1 sig=<128 hex>
//! sdr1 deny fleet=moon number=1 certificate=<64 hex> holder=robot/robot-3 sig=<128 hex>
//! ```

use std::fmt;

use ring::signature::{ECDSA_P256_SHA256_FIXED, UnparsedPublicKey};
use thiserror::Error;

use crate::{
    hex,
    holder::{Fingerprint, Holder},
    mesh_key::KeyId,
    trust::Trust,
};

/// Longest statement, bytes: a record of the fleet table carries it.
pub const STATEMENT_BYTES_MAX: usize = 512;
/// Length of a signature (r, s), bytes.
const SIGNATURE_BYTES: usize = 64;

/// Which mesh key is the newest, and how many certificates were denied when it was made.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct KeyNotice {
    /// The fleet.
    pub fleet: String,
    /// The newest key's number.
    pub key: KeyId,
    /// [`crate::MeshKey::check`] of the newest key.
    pub check: String,
    /// Denials 1 to this number belong to it: whoever hands the key out has all of them.
    pub denied: u32,
}

/// One certificate that counts no more.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Denial {
    /// The fleet.
    pub fleet: String,
    /// Counts the denials of the fleet from 1.
    pub number: u32,
    /// Which certificate.
    pub certificate: Fingerprint,
    /// Whose it was.
    pub holder: Holder,
}

/// Why a statement is not believed. The peer or a file is to blame; nothing changed.
#[derive(Clone, Debug, PartialEq, Eq, Error)]
pub enum StatementError {
    /// Too long for any statement.
    #[error("{0} bytes; a statement has at most {STATEMENT_BYTES_MAX}")]
    TooLong(usize),
    /// Not the words of a statement.
    #[error("no statement of an authority: {0}")]
    Words(&'static str),
    /// Another authority's, or nobody's.
    #[error("not signed by this fleet's authority")]
    Signature,
    /// Of another fleet.
    #[error("a statement of fleet `{found}`, this is `{own}`")]
    Fleet {
        /// What it says.
        found: String,
        /// What it should say.
        own: String,
    },
}

/// A [`KeyNotice`] whose signature was checked.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct SignedNotice {
    notice: KeyNotice,
    line: String,
}

/// A [`Denial`] whose signature was checked.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct SignedDenial {
    denial: Denial,
    line: String,
}

impl SignedNotice {
    /// Reads and checks a line.
    pub(crate) fn verify(line: &str, trust: &Trust) -> Result<Self, StatementError> {
        let notice = KeyNotice::parse(text_of(line, trust)?)?;
        expect_fleet(&notice.fleet, trust)?;
        Ok(Self { notice, line: line.into() })
    }

    /// What it says.
    pub fn notice(&self) -> &KeyNotice {
        &self.notice
    }

    /// The signed line, at most [`STATEMENT_BYTES_MAX`] bytes.
    pub fn line(&self) -> &str {
        &self.line
    }
}

impl SignedDenial {
    /// Reads and checks a line.
    pub(crate) fn verify(line: &str, trust: &Trust) -> Result<Self, StatementError> {
        let denial = Denial::parse(text_of(line, trust)?)?;
        expect_fleet(&denial.fleet, trust)?;
        Ok(Self { denial, line: line.into() })
    }

    /// What it says.
    pub fn denial(&self) -> &Denial {
        &self.denial
    }

    /// The signed line, at most [`STATEMENT_BYTES_MAX`] bytes.
    pub fn line(&self) -> &str {
        &self.line
    }
}

/// The signed words of a line.
fn text_of<'a>(line: &'a str, trust: &Trust) -> Result<&'a str, StatementError> {
    if line.len() > STATEMENT_BYTES_MAX {
        return Err(StatementError::TooLong(line.len()));
    }
    let (text, signature) =
        line.rsplit_once(" sig=").ok_or(StatementError::Words("no signature"))?;
    let signature: [u8; SIGNATURE_BYTES] =
        hex::decode(signature).ok_or(StatementError::Words("a signature has 128 digits"))?;
    UnparsedPublicKey::new(&ECDSA_P256_SHA256_FIXED, trust.point())
        .verify(text.as_bytes(), &signature)
        .map_err(|_| StatementError::Signature)?;
    Ok(text)
}

fn expect_fleet(found: &str, trust: &Trust) -> Result<(), StatementError> {
    match found == trust.fleet() {
        true => Ok(()),
        false => {
            let own = trust.fleet().into();
            Err(StatementError::Fleet { found: found.into(), own })
        }
    }
}

impl KeyNotice {
    fn parse(text: &str) -> Result<Self, StatementError> {
        let mut words = Words::of(text, "keys")?;
        let fleet = words.value("fleet=")?.to_owned();
        let key = KeyId(words.number("key=")?);
        let check = words.value("check=")?.to_owned();
        let denied = words.number("denied=")?;
        words.end(Self { fleet, key, check, denied })
    }
}

impl fmt::Display for KeyNotice {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self { fleet, key, check, denied } = self;
        write!(f, "sdr1 keys fleet={fleet} key={key} check={check} denied={denied}")
    }
}

impl Denial {
    fn parse(text: &str) -> Result<Self, StatementError> {
        let mut words = Words::of(text, "deny")?;
        let fleet = words.value("fleet=")?.to_owned();
        let number = words.number("number=")?;
        let certificate = Fingerprint::parse(words.value("certificate=")?)
            .ok_or(StatementError::Words("a certificate has 64 digits"))?;
        let holder = Holder::parse(words.value("holder=")?)
            .ok_or(StatementError::Words("a holder is robot/NAME, view/NAME or operate/NAME"))?;
        words.end(Self { fleet, number, certificate, holder })
    }
}

impl fmt::Display for Denial {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self { fleet, number, certificate, holder } = self;
        write!(
            f,
            "sdr1 deny fleet={fleet} number={number} certificate={certificate} holder={holder}"
        )
    }
}

/// The words of a statement, taken in order.
struct Words<'a>(std::str::Split<'a, char>);

impl<'a> Words<'a> {
    fn of(text: &'a str, kind: &str) -> Result<Self, StatementError> {
        let mut words = text.split(' ');
        match (words.next(), words.next()) {
            (Some("sdr1"), Some(found)) if found == kind => Ok(Self(words)),
            _ => Err(StatementError::Words("it begins otherwise")),
        }
    }

    fn value(&mut self, key: &'static str) -> Result<&'a str, StatementError> {
        let word = self.0.next().and_then(|word| word.strip_prefix(key));
        word.ok_or(StatementError::Words(key))
    }

    fn number<T: std::str::FromStr>(&mut self, key: &'static str) -> Result<T, StatementError> {
        self.value(key)?.parse().map_err(|_| StatementError::Words(key))
    }

    fn end<T>(mut self, whole: T) -> Result<T, StatementError> {
        self.0.next().map_or(Ok(whole), |_| Err(StatementError::Words("more words than it has")))
    }
}
