//! Who may connect: certificates of the fleet's authority that are not denied.
//!
//! No wall clock decides: a certificate outside its time is let in and told of, since a
//! robot's clock may be wrong by years. What removes somebody is the deny-list.

use std::{
    fmt,
    sync::{PoisonError, RwLock},
};

use rustls::pki_types::{CertificateDer, UnixTime};
use webpki::{EndEntityCert, KeyUsage, anchor_from_trusted_cert};

use crate::{
    holder::{Bearer, Fingerprint, Holder},
    papers::DenyList,
    statement::SignedDenial,
    trust::Trust,
};

/// Who is expected at the other end.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Wanted {
    /// Any robot of the fleet.
    Robot,
    /// Any operator of the fleet.
    Operator,
}

impl fmt::Display for Wanted {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::Robot => "a robot",
            Self::Operator => "an operator",
        })
    }
}

/// Why somebody is not let in. The other end is to blame.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Refused {
    /// Bytes that are no certificate, or one without a name of ours.
    Nameless,
    /// Not signed by this fleet's authority.
    Stranger {
        /// The name it claims.
        claims: String,
    },
    /// Denied by the authority.
    Denied(Holder),
    /// Of this fleet, and not who is expected here.
    Unwanted {
        /// Who it is.
        holder: Holder,
        /// Who is expected.
        wanted: Wanted,
    },
}

impl fmt::Display for Refused {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Nameless => f.write_str("no certificate of any fleet"),
            Self::Stranger { claims } => {
                write!(f, "a certificate of another authority, which says {claims}")
            }
            Self::Denied(holder) => write!(f, "{holder} was revoked"),
            Self::Unwanted { holder, wanted } => write!(f, "{holder} is not {wanted}"),
        }
    }
}

/// Whether a certificate is in its time.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Standing {
    /// It is.
    InTime,
    /// Its time is over, or the clock is wrong.
    Expired,
    /// Its time has not come, or the clock is wrong.
    NotYet,
}

/// The deny-list with the authority it belongs to.
#[derive(Debug)]
pub struct Gate {
    trust: Trust,
    denied: RwLock<DenyList>,
}

impl Gate {
    /// The gate of that authority's fleet.
    pub fn new(trust: &Trust, denied: DenyList) -> Self {
        Self { trust: trust.clone(), denied: RwLock::new(denied) }
    }

    /// Denies one more certificate; whether that is news.
    pub fn deny(&self, denial: SignedDenial) -> bool {
        self.denied.write().unwrap_or_else(PoisonError::into_inner).add(denial)
    }

    /// Who is denied now.
    pub fn denied(&self) -> DenyList {
        self.denied.read().unwrap_or_else(PoisonError::into_inner).clone()
    }

    /// Whether this certificate counts no more.
    pub fn is_denied(&self, certificate: &Fingerprint) -> bool {
        let denied = self.denied.read().unwrap_or_else(PoisonError::into_inner);
        denied.holder_of(certificate).is_some()
    }

    /// Who shows `certificate`, when it may come in. That it has the certificate's key is
    /// the handshake's to prove.
    pub fn admit(
        &self,
        certificate: &CertificateDer<'_>,
        wanted: &Wanted,
        now: UnixTime,
    ) -> Result<Bearer, Refused> {
        let (bearer, _) = inspect(certificate, &self.trust, now)?;
        if self.is_denied(&bearer.fingerprint) {
            return Err(Refused::Denied(bearer.holder));
        }
        let fits = match (&bearer.holder, wanted) {
            (Holder::Robot(_), Wanted::Robot) | (Holder::Operator { .. }, Wanted::Operator) => true,
            (Holder::Robot(_), Wanted::Operator) | (Holder::Operator { .. }, Wanted::Robot) => {
                false
            }
        };
        match fits {
            true => Ok(bearer),
            false => Err(Refused::Unwanted { holder: bearer.holder, wanted: wanted.clone() }),
        }
    }
}

/// Whose certificate that is, when `authority` signed it.
pub(crate) fn inspect(
    certificate: &CertificateDer<'_>,
    trust: &Trust,
    now: UnixTime,
) -> Result<(Bearer, Standing), Refused> {
    let parsed = EndEntityCert::try_from(certificate).map_err(|_| Refused::Nameless)?;
    let mut names = parsed.valid_uri_names();
    let named = names.next().and_then(Holder::of_uri).filter(|_| names.next().is_none());
    let (fleet, holder) = named.ok_or(Refused::Nameless)?;
    let standing = signed_by(&parsed, trust.certificate(), now)
        .filter(|_| fleet == trust.fleet())
        .ok_or_else(|| Refused::Stranger { claims: holder.uri(&fleet) })?;
    Ok((Bearer { fleet, holder, fingerprint: Fingerprint::of(certificate) }, standing))
}

/// Whether `authority` signed it, and how it stands in time.
fn signed_by(
    certificate: &EndEntityCert<'_>,
    authority: &CertificateDer<'_>,
    now: UnixTime,
) -> Option<Standing> {
    let anchor = anchor_from_trusted_cert(authority).ok()?;
    let at = |time| {
        let algorithms = &[webpki::ring::ECDSA_P256_SHA256];
        // All certificates of ours may open a connection; robots' may also answer one.
        let usage = KeyUsage::client_auth();
        let anchors = std::slice::from_ref(&anchor);
        certificate.verify_for_usage(algorithms, anchors, &[], time, usage, None, None).map(drop)
    };
    match at(now) {
        Ok(()) => Some(Standing::InTime),
        Err(webpki::Error::CertExpired { not_after, .. }) => {
            at(not_after).ok().map(|()| Standing::Expired)
        }
        Err(webpki::Error::CertNotValidYet { not_before, .. }) => {
            at(not_before).ok().map(|()| Standing::NotYet)
        }
        Err(_) => None,
    }
}
