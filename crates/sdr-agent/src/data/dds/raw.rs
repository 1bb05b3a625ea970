//! CDR bodies through RustDDS as they are: no message type is known here.

use std::{cell::RefCell, convert::Infallible};

use bytes::Bytes;
use rustdds::{RepresentationIdentifier, no_key};

/// The adapter of both directions: little-endian CDR, neither read nor changed.
pub(super) struct Raw;

impl no_key::SerializerAdapter<Bytes> for Raw {
    type Error = Infallible;

    fn output_encoding() -> RepresentationIdentifier {
        RepresentationIdentifier::CDR_LE
    }

    fn to_bytes(body: &Bytes) -> Result<Bytes, Infallible> {
        Ok(body.clone())
    }
}

impl no_key::DeserializerAdapter<()> for Raw {
    type Error = Infallible;
    type Decoded = ();

    fn supported_encodings() -> &'static [RepresentationIdentifier] {
        &[RepresentationIdentifier::CDR_LE]
    }

    fn transform_decoded((): ()) {}
}

/// Copies a body out of the DDS cache into the caller's buffer.
#[derive(Clone)]
pub(super) struct CopyInto<'a>(pub(super) &'a RefCell<Vec<u8>>);

impl no_key::Decode<'_, ()> for CopyInto<'_> {
    type Error = Infallible;

    fn decode_bytes(
        self,
        body: &[u8],
        _encoding: RepresentationIdentifier,
    ) -> Result<(), Infallible> {
        let mut buffer = self.0.borrow_mut();
        buffer.clear();
        buffer.extend_from_slice(body);
        Ok(())
    }
}
