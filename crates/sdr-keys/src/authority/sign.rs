//! Certificates and signed lines.

use std::{fmt::Display, path::Path, time::Duration};

use rcgen::{
    BasicConstraints, Certificate, CertificateParams, DistinguishedName, DnType,
    ExtendedKeyUsagePurpose, IsCa, Issuer, KeyPair, KeyUsagePurpose, SanType, date_time_ymd,
};
use ring::{
    rand::SystemRandom,
    signature::{ECDSA_P256_SHA256_FIXED_SIGNING, EcdsaKeyPair},
};
use rustls::pki_types::UnixTime;

use crate::{folder::KeysError, hex, holder::Holder};

const DAY: u64 = 86_400;
/// Clocks of robots may lag behind the operator's.
const BACKDATED: Duration = Duration::from_secs(DAY);
/// Then it expires, which warns and refuses nobody.
const YEARS: i32 = 10;

/// A new ECDSA P-256 key.
pub(super) fn new_key(folder: &Path) -> Result<KeyPair, KeysError> {
    KeyPair::generate().map_err(|error| wrong(folder, "make a key", &error))
}

/// The certificate of a fleet's authority, signed by itself.
pub(super) fn authority_certificate(
    fleet: &str,
    key: &KeyPair,
    wall: UnixTime,
    folder: &Path,
) -> Result<Certificate, KeysError> {
    let params = authority_params(fleet, wall);
    params.self_signed(key).map_err(|error| wrong(folder, "sign a certificate", &error))
}

/// The certificate of `holder` with `key`, signed by the authority's `authority_key`.
pub(super) fn certificate(
    fleet: &str,
    holder: &Holder,
    key: &KeyPair,
    authority_key: &KeyPair,
    wall: UnixTime,
    folder: &Path,
) -> Result<Certificate, KeysError> {
    let mut params = params(&holder.uri(fleet), &holder.to_string(), wall);
    params.key_usages = vec![KeyUsagePurpose::DigitalSignature];
    params.extended_key_usages = match holder {
        Holder::Robot(_) => {
            vec![ExtendedKeyUsagePurpose::ServerAuth, ExtendedKeyUsagePurpose::ClientAuth]
        }
        Holder::Operator { .. } => vec![ExtendedKeyUsagePurpose::ClientAuth],
    };
    let issuer = Issuer::new(authority_params(fleet, wall), authority_key);
    params.signed_by(key, &issuer).map_err(|error| wrong(folder, "sign a certificate", &error))
}

/// `TEXT sig=HEX`.
///
/// # Panics
/// When the system has no randomness: it had some when the key was made.
pub(super) fn line(text: &impl Display, key: &KeyPair) -> String {
    let text = text.to_string();
    let random = SystemRandom::new();
    let signer =
        EcdsaKeyPair::from_pkcs8(&ECDSA_P256_SHA256_FIXED_SIGNING, &key.serialize_der(), &random);
    let signer = signer.expect("the key is ECDSA P-256: it is the certificate's");
    let signature = signer.sign(&random, text.as_bytes()).expect("the system has randomness");
    format!("{text} sig={}", hex::encode(signature.as_ref()))
}

fn authority_params(fleet: &str, wall: UnixTime) -> CertificateParams {
    let mut params = params(&format!("sdr://{fleet}/authority"), &format!("fleet {fleet}"), wall);
    params.is_ca = IsCa::Ca(BasicConstraints::Constrained(0));
    params.key_usages = vec![KeyUsagePurpose::KeyCertSign, KeyUsagePurpose::DigitalSignature];
    params
}

fn params(uri: &str, name: &str, wall: UnixTime) -> CertificateParams {
    let mut params = CertificateParams::default();
    let (year, month, day) = date(wall.as_secs().saturating_sub(BACKDATED.as_secs()) / DAY);
    params.not_before = date_time_ymd(year, month, day);
    // A day that every year has.
    params.not_after = date_time_ymd(year + YEARS, month, day.min(28));
    params.subject_alt_names = vec![SanType::URI(uri.try_into().expect("names are ASCII"))];
    params.distinguished_name = DistinguishedName::new();
    params.distinguished_name.push(DnType::OrganizationName, "sdr");
    params.distinguished_name.push(DnType::CommonName, name);
    params
}

/// Year, month and day of a count of days since 1970, after the Gregorian calendar:
/// <https://howardhinnant.github.io/date_algorithms.html#civil_from_days>.
fn date(days: u64) -> (i32, u8, u8) {
    let days = days.min(1_000_000) + 719_468;
    let (era, day_of_era) = (days / 146_097, days % 146_097);
    let year_of_era =
        (day_of_era - day_of_era / 1_460 + day_of_era / 36_524 - day_of_era / 146_096) / 365;
    let day_of_year = day_of_era - (365 * year_of_era + year_of_era / 4 - year_of_era / 100);
    let shifted = (5 * day_of_year + 2) / 153;
    let day = day_of_year - (153 * shifted + 2) / 5 + 1;
    let month = if shifted < 10 { shifted + 3 } else { shifted - 9 };
    let year = year_of_era + era * 400 + u64::from(month <= 2);
    let small = |number| u8::try_from(number).expect("a day or a month");
    (i32::try_from(year).expect("bounded above"), small(month), small(day))
}

fn wrong(folder: &Path, what: &'static str, error: &rcgen::Error) -> KeysError {
    let source = std::io::Error::other(error.to_string());
    KeysError::Io { file: folder.into(), what, source }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn days_are_dates() {
        assert_eq!(date(0), (1970, 1, 1));
        assert_eq!(date(11_016), (2000, 2, 29));
        assert_eq!(date(20_779), (2026, 11, 22));
    }
}
