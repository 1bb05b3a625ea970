//! The fleet's authority: a folder on an operator's machine, needed only to issue and revoke.
//!
//! ```text
//! authority.crt, authority.key   its certificate and secret key
//! mesh.keys                      the newest mesh keys
//! notices                        what it said to the fleet: newest key, denials
//! issued/robot/NAME.crt          certificates, one each; secret keys are never kept here
//! issued/operator/NAME.crt
//! lock                           one command at a time
//! ```

mod issue;
mod revoke;
mod sign;

#[cfg(test)]
mod tests;

use std::{
    fmt,
    fs::File,
    path::{Path, PathBuf},
    time::Duration,
};

use rcgen::KeyPair;
use ring::rand::{SecureRandom as _, SystemRandom};
use rustls::pki_types::UnixTime;
use sdr_core::id::RobotId;

use crate::{
    folder::{KeysError, make_private, read_secret, read_text, write_private},
    keyset::{MESH_KEYS, NOTICES},
    mesh_key::{KeyId, MeshKey, MeshKeys},
    papers::{DenyList, Papers},
    statement::KeyNotice,
    trust::Trust,
};
pub use issue::{Issued, Made};
pub use revoke::Revoked;

const CERTIFICATE: &str = "authority.crt";
const KEY: &str = "authority.key";
/// An opened authority; nobody else changes it meanwhile.
pub struct Authority {
    folder: PathBuf,
    trust: Trust,
    key: KeyPair,
    keys: MeshKeys,
    papers: Papers,
    wall: UnixTime,
    _lock: File,
}

/// What an authority has, for people.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Overview {
    /// Its fleet.
    pub fleet: String,
    /// The newest mesh key.
    pub newest_key: KeyId,
    /// Certificates issued last for each name.
    pub issued: Vec<Certificate>,
}

/// One certificate, for people.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Certificate {
    /// `robot/NAME`, `view/NAME` or `operate/NAME`.
    pub holder: crate::Holder,
    /// Which one.
    pub fingerprint: crate::Fingerprint,
    /// The number of its denial, when it was revoked.
    pub denial: Option<u32>,
}

impl Authority {
    /// Makes the authority of `fleet` in `folder`, or opens the one that is there. `wall` is
    /// the time since 1970, from which certificates count theirs.
    pub fn init(folder: &Path, fleet: &RobotId, wall: Duration) -> Result<(Self, Made), KeysError> {
        if folder.join(CERTIFICATE).exists() {
            let there = Self::open(folder, wall)?;
            return match there.trust.fleet() == fleet.as_str() {
                true => Ok((there, Made::There)),
                false => Err(KeysError::Taken {
                    place: folder.into(),
                    found: format!("the authority of fleet `{}` is there", there.trust.fleet()),
                    next: format!("give `{fleet}` a folder of its own: --authority DIR"),
                }),
            };
        }
        let wall = UnixTime::since_unix_epoch(wall);
        make_private(folder)?;
        let lock = lock(folder)?;
        if folder.join(KEY).exists() {
            return Err(KeysError::Taken {
                place: folder.join(KEY),
                found: "a secret key without its certificate".into(),
                next: "an `init` was interrupted: remove this file and try again".into(),
            });
        }
        let key = sign::new_key(folder)?;
        let certificate = sign::authority_certificate(fleet.as_str(), &key, wall, folder)?;
        let keys = MeshKeys::first(MeshKey::new(KeyId(1), random(folder)?));
        let trust = Trust::of(certificate.der().clone()).expect("it was made just so");
        let papers = sign_papers(&trust, &key, &keys, DenyList::default());
        write_private(&folder.join(MESH_KEYS), &keys.to_text())?;
        write_private(&folder.join(NOTICES), &papers.to_text())?;
        write_private(&folder.join(KEY), &key.serialize_pem())?;
        // The last: what opens, is whole.
        write_private(&folder.join(CERTIFICATE), &certificate.pem())?;
        let made = Self { folder: folder.into(), trust, key, keys, papers, wall, _lock: lock };
        Ok((made, Made::New))
    }

    /// Opens the authority in `folder`.
    pub fn open(folder: &Path, wall: Duration) -> Result<Self, KeysError> {
        let certificate = folder.join(CERTIFICATE);
        if !certificate.exists() {
            let next = "`sdr keys init` makes an authority, --authority DIR names another".into();
            return Err(KeysError::Missing { file: certificate, next });
        }
        let lock = lock(folder)?;
        let trust = Trust::load(&certificate)?;
        let key_file = folder.join(KEY);
        let key = KeyPair::from_pem(&read_secret(&key_file)?).ok();
        let key = key.filter(|key| key.public_key_raw() == trust.point());
        let key = key.ok_or_else(|| KeysError::Mismatch {
            file: key_file,
            found: format!("not the key of {}", certificate.display()),
            next: "bring both back from a copy of this folder".into(),
        })?;
        let keys_file = folder.join(MESH_KEYS);
        let keys = MeshKeys::parse(&keys_file, &read_secret(&keys_file)?)?;
        let notices = folder.join(NOTICES);
        let mut papers =
            Papers::parse(&read_text(&notices)?, &trust).map_err(|error| KeysError::Malformed {
                file: notices,
                found: error.to_string(),
                allowed: "what this authority signed; bring the file back from a copy".into(),
            })?;
        if !papers.name(keys.newest()) {
            // A rotation was interrupted between its two files; nobody has seen the new key.
            papers = sign_papers(&trust, &key, &keys, papers.denied().clone());
        }
        let wall = UnixTime::since_unix_epoch(wall);
        Ok(Self { folder: folder.into(), trust, key, keys, papers, wall, _lock: lock })
    }

    /// Its fleet.
    pub fn fleet(&self) -> &str {
        self.trust.fleet()
    }

    /// Where it is.
    pub fn folder(&self) -> &Path {
        &self.folder
    }

    /// The newest mesh key: a secret of the robots.
    pub fn newest_key(&self) -> &MeshKey {
        self.keys.newest()
    }

    /// What the fleet is to know.
    pub fn papers(&self) -> &Papers {
        &self.papers
    }

    /// Makes a new mesh key, which the fleet takes when one robot is told.
    pub fn rotate(&mut self) -> Result<KeyId, KeysError> {
        let denied = self.papers.denied().clone();
        self.renew(denied)
    }

    /// A new key together with a new list of denials.
    fn renew(&mut self, denied: DenyList) -> Result<KeyId, KeysError> {
        let file = self.folder.join(MESH_KEYS);
        let id = self.keys.newest().id().next().ok_or_else(|| KeysError::Taken {
            place: file.clone(),
            found: "65535 keys were made".into(),
            next: "make a new authority".into(),
        })?;
        let mut keys = self.keys.clone();
        keys.add(MeshKey::new(id, random(&self.folder)?));
        let papers = sign_papers(&self.trust, &self.key, &keys, denied);
        write_private(&file, &keys.to_text())?;
        write_private(&self.folder.join(NOTICES), &papers.to_text())?;
        (self.keys, self.papers) = (keys, papers);
        Ok(id)
    }
}

impl fmt::Debug for Authority {
    /// Without keys.
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "Authority({} in {})", self.fleet(), self.folder.display())
    }
}

fn sign_papers(trust: &Trust, key: &KeyPair, keys: &MeshKeys, denied: DenyList) -> Papers {
    let newest = keys.newest();
    let notice = KeyNotice {
        fleet: trust.fleet().into(),
        key: newest.id(),
        check: newest.check(),
        denied: u32::try_from(denied.len()).expect("denials are bounded"),
    };
    let line = sign::line(&notice, key);
    let notice = trust.read_notice(&line).expect("it was signed just now");
    Papers::new(notice, denied).expect("it counts them all")
}

/// Takes the folder for this process.
fn lock(folder: &Path) -> Result<File, KeysError> {
    let path = folder.join("lock");
    let file = File::options().create(true).truncate(false).write(true).open(&path);
    let what = "lock";
    let file = file.map_err(|source| KeysError::Io { file: path.clone(), what, source })?;
    match file.try_lock() {
        Ok(()) => Ok(file),
        Err(std::fs::TryLockError::WouldBlock) => Err(KeysError::Taken {
            place: folder.into(),
            found: "another `sdr keys` works there".into(),
            next: "try again when it has ended".into(),
        }),
        Err(std::fs::TryLockError::Error(source)) => {
            Err(KeysError::Io { file: path, what, source })
        }
    }
}

fn random<const N: usize>(folder: &Path) -> Result<[u8; N], KeysError> {
    let mut bytes = [0; N];
    SystemRandom::new().fill(&mut bytes).map_err(|_| KeysError::Io {
        file: folder.into(),
        what: "draw randomness",
        source: std::io::Error::other("the system has none"),
    })?;
    Ok(bytes)
}
