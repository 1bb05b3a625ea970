//! The authority as its fleet knows it: a certificate, by which statements are checked.

use std::{fmt, path::Path};

use rustls::pki_types::{CertificateDer, pem::PemObject as _};
use sdr_core::id::RobotId;
use webpki::EndEntityCert;

use crate::{
    folder::{KeysError, read_text},
    statement::{SignedDenial, SignedNotice, StatementError},
};

/// One fleet's authority. Its certificate names the fleet: `sdr://FLEET/authority`.
#[derive(Clone)]
pub struct Trust {
    fleet: String,
    certificate: CertificateDer<'static>,
    point: Vec<u8>,
}

impl Trust {
    /// Reads the authority's certificate.
    pub(crate) fn load(path: &Path) -> Result<Self, KeysError> {
        let certificate = read_certificate(path)?;
        Self::of(certificate).ok_or_else(|| KeysError::Malformed {
            file: path.into(),
            found: "no certificate of a fleet's authority".into(),
            allowed: "the file that `sdr keys init` made".into(),
        })
    }

    /// The authority of that certificate.
    pub(crate) fn of(certificate: CertificateDer<'static>) -> Option<Self> {
        let (fleet, point) = {
            let parsed = EndEntityCert::try_from(&certificate).ok()?;
            let name = parsed.valid_uri_names().next()?;
            let fleet = name.strip_prefix("sdr://")?.strip_suffix("/authority")?;
            (RobotId::new(fleet).ok()?.to_string(), point_of(&parsed)?)
        };
        Some(Self { fleet, point, certificate })
    }

    /// The fleet.
    pub fn fleet(&self) -> &str {
        &self.fleet
    }

    /// Reads a key notice and checks that this authority signed it.
    pub fn read_notice(&self, line: &str) -> Result<SignedNotice, StatementError> {
        SignedNotice::verify(line, self)
    }

    /// Reads a denial and checks that this authority signed it.
    pub fn read_denial(&self, line: &str) -> Result<SignedDenial, StatementError> {
        SignedDenial::verify(line, self)
    }

    pub(crate) fn certificate(&self) -> &CertificateDer<'static> {
        &self.certificate
    }

    /// An uncompressed point of P-256.
    pub(crate) fn point(&self) -> &[u8] {
        &self.point
    }
}

impl fmt::Debug for Trust {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "Trust({})", self.fleet)
    }
}

/// The public point of a certificate with an ECDSA P-256 key.
fn point_of(certificate: &EndEntityCert<'_>) -> Option<Vec<u8>> {
    /// A SubjectPublicKeyInfo of P-256 (RFC 5480): no other kind of key has this length.
    const SPKI_BYTES: usize = 91;
    /// An uncompressed point ends it.
    const POINT_BYTES: usize = 65;
    let spki = certificate.subject_public_key_info();
    let point = spki.get(SPKI_BYTES - POINT_BYTES..)?;
    (spki.len() == SPKI_BYTES && point[0] == 4).then(|| point.to_vec())
}

pub(crate) fn read_certificate(path: &Path) -> Result<CertificateDer<'static>, KeysError> {
    let text = read_text(path)?;
    CertificateDer::from_pem_slice(text.as_bytes()).map_err(|_| KeysError::Malformed {
        file: path.into(),
        found: "no certificate".into(),
        allowed: "PEM: -----BEGIN CERTIFICATE-----, as `sdr keys` made it".into(),
    })
}
