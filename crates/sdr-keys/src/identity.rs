//! Who this robot or operator is: its certificate, its key, and the authority it trusts.

use std::{fmt, path::Path, time::Duration};

use rustls::{
    crypto::ring as provider,
    pki_types::{CertificateDer, PrivateKeyDer, UnixTime, pem::PemObject as _},
    sign::CertifiedKey,
};

use crate::{
    folder::{KeysError, read_secret},
    holder::{Bearer, Fingerprint, Holder},
    tls::gate::{Standing, inspect},
    trust::{Trust, read_certificate},
};

/// The authority's certificate in a folder of keys.
pub(crate) const AUTHORITY_CERTIFICATE: &str = "fleet.crt";
/// The own certificate in a folder of keys.
pub(crate) const OWN_CERTIFICATE: &str = "own.crt";
/// The own secret key in a folder of keys.
pub(crate) const OWN_KEY: &str = "own.key";

/// One certificate with its key, of a robot or an operator.
pub struct Identity {
    bearer: Bearer,
    standing: Standing,
    certificate: CertificateDer<'static>,
    key: PrivateKeyDer<'static>,
    trust: Trust,
}

impl Identity {
    /// Reads `fleet.crt`, `own.crt` and `own.key` in `folder` and checks that they belong
    /// together. `wall` is the time since 1970 as this machine believes it: a certificate that is
    /// expired by it is still taken ([`Identity::standing`] says so).
    pub fn load(folder: &Path, wall: Duration) -> Result<Self, KeysError> {
        let authority_file = folder.join(AUTHORITY_CERTIFICATE);
        let trust = Trust::load(&authority_file)?;
        let own_file = folder.join(OWN_CERTIFICATE);
        let certificate = read_certificate(&own_file)?;
        let (bearer, standing) = inspect(&certificate, &trust, UnixTime::since_unix_epoch(wall))
            .map_err(|refused| KeysError::Mismatch {
                file: own_file.clone(),
                found: format!("{refused}; the authority is that of {}", authority_file.display()),
                next: "copy the whole folder that `sdr keys` made".into(),
            })?;
        let key_file = folder.join(OWN_KEY);
        let key = read_key(&key_file)?;
        let provider = provider::default_provider();
        CertifiedKey::from_der(vec![certificate.clone()], key.clone_key(), &provider).map_err(
            |_| KeysError::Mismatch {
                file: key_file,
                found: format!("not the key of {}", own_file.display()),
                next: "copy the whole folder that `sdr keys` made".into(),
            },
        )?;
        Ok(Self { bearer, standing, certificate, key, trust })
    }

    /// The fleet.
    pub fn fleet(&self) -> &str {
        &self.bearer.fleet
    }

    /// Whom the certificate is for.
    pub fn holder(&self) -> &Holder {
        &self.bearer.holder
    }

    /// Which certificate it is.
    pub fn fingerprint(&self) -> Fingerprint {
        self.bearer.fingerprint
    }

    /// Whether the certificate was in its time when it was loaded.
    pub fn standing(&self) -> Standing {
        self.standing
    }

    /// The authority that it trusts.
    pub fn trust(&self) -> &Trust {
        &self.trust
    }

    pub(crate) fn chain(&self) -> Vec<CertificateDer<'static>> {
        vec![self.certificate.clone()]
    }

    pub(crate) fn key(&self) -> PrivateKeyDer<'static> {
        self.key.clone_key()
    }
}

impl fmt::Debug for Identity {
    /// Without the key.
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "Identity({} of {})", self.bearer, self.bearer.fleet)
    }
}

fn read_key(path: &Path) -> Result<PrivateKeyDer<'static>, KeysError> {
    let text = read_secret(path)?;
    PrivateKeyDer::from_pem_slice(text.as_bytes()).map_err(|_| KeysError::Malformed {
        file: path.into(),
        found: "no secret key".into(),
        allowed: "PEM: -----BEGIN PRIVATE KEY-----, as `sdr keys` made it".into(),
    })
}
