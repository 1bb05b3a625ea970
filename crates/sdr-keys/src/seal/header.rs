//! The sixteen bytes before the sealed ones, and the sub-key they lead to.

use ring::{
    aead::{Aad, CHACHA20_POLY1305, LessSafeKey, NONCE_LEN, Nonce, UnboundKey},
    hkdf::{HKDF_SHA256, Salt},
};

use crate::mesh_key::{KeyId, MeshKey};

/// Length of the header.
const HEADER_BYTES: usize = 16;
/// Length of the tag.
const TAG_BYTES: usize = 16;
/// How much longer a sealed datagram is than what it holds.
pub const OVERHEAD_BYTES: usize = HEADER_BYTES + TAG_BYTES;
/// Version 1; the top two bits are clear, which tells sealed datagrams from QUIC's on one port.
const VERSION: u8 = 0x10;
/// The counter has 40 bits.
pub(super) const COUNTER_MAX: u64 = (1 << 40) - 1;

/// Random bytes that name one start of a sender.
pub(super) type Start = [u8; 8];

/// What a datagram is for.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Kind {
    /// It holds a datagram of the mesh.
    Data = 0,
    /// Do you live? Start asked, then a random number.
    Challenge = 1,
    /// I live: the random number.
    Proof = 2,
    /// It holds a signed line of the authority.
    Notice = 3,
}

/// Who sealed a datagram, with what.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Header {
    pub(super) kind: Kind,
    pub(super) key: KeyId,
    pub(super) start: Start,
    pub(super) counter: u64,
}

impl Header {
    /// Reads the header of a datagram that is long enough to be sealed.
    pub(super) fn read(datagram: &[u8]) -> Option<Self> {
        if datagram.len() < OVERHEAD_BYTES {
            return None;
        }
        let kind = [Kind::Data, Kind::Challenge, Kind::Proof, Kind::Notice]
            .into_iter()
            .find(|kind| VERSION | *kind as u8 == datagram[0])?;
        let mut counter = [0; 8];
        counter[3..].copy_from_slice(&datagram[11..16]);
        Some(Self {
            kind,
            key: KeyId(u16::from_be_bytes([datagram[1], datagram[2]])),
            start: datagram[3..11].try_into().expect("eight bytes"),
            counter: u64::from_be_bytes(counter),
        })
    }

    pub(super) fn bytes(&self) -> [u8; HEADER_BYTES] {
        let mut bytes = [0; HEADER_BYTES];
        bytes[0] = VERSION | self.kind as u8;
        bytes[1..3].copy_from_slice(&self.key.0.to_be_bytes());
        bytes[3..11].copy_from_slice(&self.start);
        bytes[11..].copy_from_slice(&self.counter.to_be_bytes()[3..]);
        bytes
    }

    fn nonce(&self) -> Nonce {
        let mut nonce = [0; NONCE_LEN];
        nonce[7..].copy_from_slice(&self.counter.to_be_bytes()[3..]);
        Nonce::assume_unique_for_key(nonce)
    }
}

/// The key of one sender start under one mesh key.
pub(super) struct SubKey {
    pub(super) id: KeyId,
    key: LessSafeKey,
}

impl SubKey {
    pub(super) fn new(mesh_key: &MeshKey, start: &Start) -> Self {
        let secret = Salt::new(HKDF_SHA256, start).extract(mesh_key.secret());
        let key = secret.expand(&[b"sdr seal 1"], &CHACHA20_POLY1305);
        let key = UnboundKey::from(key.expect("32 bytes are allowed"));
        Self { id: mesh_key.id(), key: LessSafeKey::new(key) }
    }

    /// Header, sealed bytes, tag.
    pub(super) fn seal(&self, header: &Header, bytes: &[u8]) -> Vec<u8> {
        let head = header.bytes();
        let mut datagram = Vec::with_capacity(bytes.len() + OVERHEAD_BYTES);
        datagram.extend(head);
        datagram.extend(bytes);
        let (_, body) = datagram.split_at_mut(HEADER_BYTES);
        let tag = self.key.seal_in_place_separate_tag(header.nonce(), Aad::from(head), body);
        datagram.extend(tag.expect("a datagram is far below the limit").as_ref());
        datagram
    }

    /// What was sealed, when nobody changed it.
    pub(super) fn open(&self, header: &Header, datagram: &[u8]) -> Option<Vec<u8>> {
        let mut body = datagram[HEADER_BYTES..].to_vec();
        let length = self
            .key
            .open_in_place(header.nonce(), Aad::from(header.bytes()), &mut body)
            .ok()?
            .len();
        body.truncate(length);
        Some(body)
    }
}
