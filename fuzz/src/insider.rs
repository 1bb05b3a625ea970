//! Seals as a robot with the key could, with any kind, start and counter; written from
//! `docs/security.md`, not from the code under test.

use ring::{
    aead::{Aad, CHACHA20_POLY1305, LessSafeKey, NONCE_LEN, Nonce, UnboundKey},
    hkdf::{HKDF_SHA256, Salt},
};
use sdr_keys::MeshKey;

/// A sealed datagram.
pub fn seal(key: &MeshKey, kind: u8, start: [u8; 8], counter: u64, bytes: &[u8]) -> Vec<u8> {
    let counter = counter & ((1 << 40) - 1);
    let mut header = vec![0x10 | (kind & 0x0f)];
    header.extend(key.id().0.to_be_bytes());
    header.extend(start);
    header.extend(&counter.to_be_bytes()[3..]);
    let mut nonce = [0; NONCE_LEN];
    nonce[7..].copy_from_slice(&counter.to_be_bytes()[3..]);
    let secret = Salt::new(HKDF_SHA256, &start).extract(key.secret());
    let sub_key = secret.expand(&[b"sdr seal 1"], &CHACHA20_POLY1305).expect("32 bytes");
    let sub_key = LessSafeKey::new(UnboundKey::from(sub_key));
    let mut body = bytes.to_vec();
    let nonce = Nonce::assume_unique_for_key(nonce);
    let sealed = sub_key.seal_in_place_append_tag(nonce, Aad::from(&header), &mut body);
    sealed.expect("far below the limit");
    header.extend(body);
    header
}
