//! The keys of a fleet: who may speak on its mesh, who may connect to its robots, who may not any more.
//!
//! ```text
//!  operator's machine                      robot (folder of robot.toml's [mesh] keys)
//!  authority ── certificate per robot ───▶ own.crt, own.key, fleet.crt ─▶ Identity ─▶ tls (streams, API)
//!      │     ── mesh keys ───────────────▶ mesh.keys ──────────────────▶ Keyring  ─▶ seal (datagrams)
//!      └─────── signed notices ──────────▶ notices ───────────────────▶ Papers   ─▶ DenyList
//! ```
//!
//! A certificate says who somebody is, and is proven on every stream. The mesh key says only
//! that a datagram comes from somebody of the fleet: what that cannot prove stands in
//! `docs/security.md`. Nothing here opens a socket or reads a clock: time and randomness
//! are passed in, files are read and written only by what has a folder as argument.
//!
//! ```
//! use std::time::Duration;
//!
//! use sdr_core::time::Instant;
//! use sdr_keys::{MeshKey, KeyId, seal::{Opened, Seal}};
//!
//! let key = || MeshKey::new(KeyId(1), [7; 32]);
//! let chance = |salt: u8| Box::new(move |bytes: &mut [u8]| bytes.fill(salt));
//! let grace = Duration::from_secs(20);
//! let seal = |salt: u8| Seal::new([key()], grace, Instant::ZERO, chance(salt));
//! let (mut here, mut there) = (seal(1), seal(2));
//!
//! let now = Instant::from_millis(1);
//! let greeting = here.seal(now, b"sixteen bytes...");
//! // A start that nobody knows must first prove that it lives now.
//! let Opened::Answer(challenge) = there.open(now, &greeting) else { panic!() };
//! let Opened::Answer(proof) = here.open(now, &challenge) else { panic!() };
//! assert_eq!(there.open(now, &proof), Opened::Proven);
//! let again = here.seal(now, b"sixteen bytes...");
//! assert_eq!(there.open(now, &again), Opened::Datagram(b"sixteen bytes...".to_vec()));
//! ```

mod hex;
mod holder;
mod mesh_key;

mod folder;
mod statement;
mod trust;

mod identity;
mod papers;

mod delivery;
mod keyset;

pub mod seal;
pub mod stream;
pub mod tls;

#[cfg(feature = "authority")]
pub mod authority;

pub use delivery::{Delivery, DeliveryAnswer, DeliveryError, Received};
pub use folder::KeysError;
pub use holder::{Bearer, Fingerprint, Holder, OperatorId, Role};
pub use identity::Identity;
pub use keyset::Keyset;
pub use mesh_key::{KeyId, MeshKey, MeshKeys};
pub use papers::{DenyList, Papers};
pub use statement::{
    Denial, KeyNotice, STATEMENT_BYTES_MAX, SignedDenial, SignedNotice, StatementError,
};
pub use trust::Trust;
