//! TLS 1.3 with certificates at both ends, for streams between robots and for the API.

pub mod gate;
mod verifier;

use std::{error::Error, io, sync::Arc};

use rustls::{
    AlertDescription, CertificateError, ClientConfig, ServerConfig, client::Resumption,
    crypto::ring as provider, server::NoServerSessionStorage, version::TLS13,
};

use crate::{holder::Holder, identity::Identity};
pub use gate::{Gate, Refused, Standing, Wanted};
use verifier::Doorkeeper;

/// Told of everybody who is not let in.
pub type OnRefusal = Arc<dyn Fn(&Refused) + Send + Sync>;

/// The end that is called: shows `identity`, lets in whom `gate` admits.
///
/// # Panics
/// When `identity` was not loaded by [`Identity::load`], which checks what could fail here.
pub fn server(
    identity: &Identity,
    gate: Arc<Gate>,
    wanted: Wanted,
    protocol: &[u8],
    on_refusal: OnRefusal,
) -> ServerConfig {
    let doorkeeper = Arc::new(Doorkeeper::new(gate, wanted, on_refusal));
    let mut config = ServerConfig::builder_with_provider(Arc::new(provider::default_provider()))
        .with_protocol_versions(&[&TLS13])
        .expect("the provider knows TLS 1.3")
        .with_client_cert_verifier(doorkeeper)
        .with_single_cert(identity.chain(), identity.key())
        .expect("checked when it was loaded");
    config.alpn_protocols = vec![protocol.to_vec()];
    // A resumed session would pass the deny-list by.
    config.session_storage = Arc::new(NoServerSessionStorage {});
    config.send_tls13_tickets = 0;
    config
}

/// The end that calls: shows `identity`, and expects a robot that `gate` admits.
///
/// # Panics
/// As [`server`].
pub fn client(
    identity: &Identity,
    gate: Arc<Gate>,
    protocol: &[u8],
    on_refusal: OnRefusal,
) -> ClientConfig {
    let doorkeeper = Arc::new(Doorkeeper::new(gate, Wanted::Robot, on_refusal));
    let mut config = ClientConfig::builder_with_provider(Arc::new(provider::default_provider()))
        .with_protocol_versions(&[&TLS13])
        .expect("the provider knows TLS 1.3")
        .dangerous()
        .with_custom_certificate_verifier(doorkeeper)
        .with_client_auth_cert(identity.chain(), identity.key())
        .expect("checked when it was loaded");
    config.alpn_protocols = vec![protocol.to_vec()];
    config.resumption = Resumption::disabled();
    config.enable_sni = false;
    config
}

/// Why a handshake failed, in words that say which end refused; `None` for other errors.
pub fn explain(error: &io::Error, own: &Holder) -> Option<String> {
    let error = error.get_ref()?.downcast_ref::<rustls::Error>()?;
    Some(explain_tls(error, own))
}

/// As [`explain`] for an error of the library itself.
pub fn explain_tls(error: &rustls::Error, own: &Holder) -> String {
    let told = |alert| *error == rustls::Error::AlertReceived(alert);
    let found = |wrong| *error == rustls::Error::InvalidCertificate(wrong);
    if told(AlertDescription::CertificateRevoked) {
        format!("it refused {own}: revoked")
    } else if told(AlertDescription::UnknownCA) {
        format!("it refused {own}: it is a robot of another fleet")
    } else if told(AlertDescription::AccessDenied) {
        format!("it refused {own}: such certificates are not for this")
    } else if told(AlertDescription::CertificateRequired) {
        "it wants a certificate".into()
    } else if found(CertificateError::Revoked) {
        "refused here: it shows a certificate that was revoked".into()
    } else if found(CertificateError::UnknownIssuer) {
        "refused here: it shows a certificate of another authority".into()
    } else if found(CertificateError::ApplicationVerificationFailure) {
        "refused here: it is not who is wanted".into()
    } else {
        error.to_string()
    }
}

impl Error for Refused {}
