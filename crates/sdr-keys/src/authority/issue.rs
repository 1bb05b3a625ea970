//! Folders for robots and operators.

use std::{
    fs,
    path::{Path, PathBuf},
};

use rustls::pki_types::{CertificateDer, pem::PemObject as _};
use sdr_core::id::RobotId;

use super::{Authority, Certificate, Overview, sign};
use crate::{
    folder::{KeysError, make_private, read_text, write_private},
    holder::{Fingerprint, Holder, Role},
    identity::{AUTHORITY_CERTIFICATE, OWN_CERTIFICATE, OWN_KEY},
    keyset::{MESH_KEYS, NOTICES},
    tls::gate::inspect,
    trust::read_certificate,
};

/// Whether something had to be made.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Made {
    /// It is new.
    New,
    /// It was there, and got newer mesh keys or notices.
    Refreshed,
    /// It was there, whole and up to date.
    There,
}

/// A folder for a robot or an operator.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Issued {
    /// Whom for.
    pub holder: Holder,
    /// Which certificate.
    pub fingerprint: Fingerprint,
    /// The folder, to be copied to the robot or the operator.
    pub folder: PathBuf,
    /// Whether it is new.
    pub made: Made,
}

impl Authority {
    /// Makes the folder of a robot, or brings newer keys and notices into it.
    pub fn add_robot(&self, name: &RobotId, out: &Path) -> Result<Issued, KeysError> {
        self.issue(Holder::Robot(name.clone()), out)
    }

    /// Makes the folder of an operator, or brings newer notices into it.
    pub fn add_operator(
        &self,
        name: &RobotId,
        role: Role,
        out: &Path,
    ) -> Result<Issued, KeysError> {
        self.issue(Holder::Operator { name: name.clone(), role }, out)
    }

    /// What it has, by kind and name.
    pub fn overview(&self) -> Result<Overview, KeysError> {
        let mut issued = Vec::new();
        for kind in ["robot", "operator"] {
            let folder = self.folder.join("issued").join(kind);
            let entries = fs::read_dir(&folder).map(|entries| entries.flatten().collect());
            let mut entries: Vec<_> = entries.unwrap_or_default();
            entries.sort_by_key(fs::DirEntry::file_name);
            for entry in entries.iter().filter(|entry| is_certificate(&entry.path())) {
                issued.push(self.read(&entry.path())?);
            }
        }
        let newest_key = self.keys.newest().id();
        Ok(Overview { fleet: self.fleet().into(), newest_key, issued })
    }

    /// The certificate that `holder`'s kind and name had last.
    pub(super) fn issued(&self, holder: &Holder) -> Result<Option<Certificate>, KeysError> {
        let path = self.place(holder);
        match path.exists() {
            true => self.read(&path).map(Some),
            false => Ok(None),
        }
    }

    fn read(&self, path: &Path) -> Result<Certificate, KeysError> {
        let der = read_certificate(path)?;
        let (bearer, _) = inspect(&der, &self.trust, self.wall).map_err(|refused| {
            let next = "bring the file back from a copy of the folder".into();
            KeysError::Mismatch { file: path.into(), found: refused.to_string(), next }
        })?;
        let denied = self
            .papers
            .denied()
            .iter()
            .find(|denial| denial.denial().certificate == bearer.fingerprint);
        let denial = denied.map(|denial| denial.denial().number);
        Ok(Certificate { holder: bearer.holder, fingerprint: bearer.fingerprint, denial })
    }

    fn issue(&self, holder: Holder, out: &Path) -> Result<Issued, KeysError> {
        let valid = self.issued(&holder)?.filter(|certificate| certificate.denial.is_none());
        let there = fingerprint_in(out)?;
        let (fingerprint, made) = match (&valid, there) {
            (Some(valid), Some(there)) if valid.fingerprint == there => {
                if valid.holder != holder {
                    return Err(KeysError::Taken {
                        place: out.into(),
                        found: format!("it is {}", valid.holder),
                        next: format!("for {holder}: sdr keys revoke {}, and again", holder.name()),
                    });
                }
                (there, self.refresh(&holder, out)?)
            }
            (Some(valid), _) => {
                let name = holder.name();
                return Err(KeysError::Taken {
                    place: out.into(),
                    found: format!("{} has a certificate, and it is not in here", valid.holder),
                    next: format!(
                        "name its folder (--out DIR), or, if it is lost: sdr keys revoke {name}, and again"
                    ),
                });
            }
            (None, _) if !is_empty(out) => {
                return Err(KeysError::Taken {
                    place: out.into(),
                    found: "there are files in it, of nobody who is known here".into(),
                    next: "name an empty or new folder: --out DIR".into(),
                });
            }
            (None, _) => (self.make(&holder, out)?, Made::New),
        };
        Ok(Issued { holder, fingerprint, folder: out.into(), made })
    }

    fn make(&self, holder: &Holder, out: &Path) -> Result<Fingerprint, KeysError> {
        let key = sign::new_key(out)?;
        let (fleet, place) = (self.fleet(), self.place(holder));
        let made = sign::certificate(fleet, holder, &key, &self.key, self.wall, out)?;
        make_private(out)?;
        // First of all: a certificate that nobody knows of could never be revoked.
        make_private(place.parent().expect("it lies in a folder"))?;
        write_private(&place, &made.pem())?;
        write_private(&out.join(OWN_KEY), &key.serialize_pem())?;
        write_private(
            &out.join(AUTHORITY_CERTIFICATE),
            &read_text(&self.folder.join(super::CERTIFICATE))?,
        )?;
        write_private(&out.join(OWN_CERTIFICATE), &made.pem())?;
        self.refresh(holder, out)?;
        Ok(Fingerprint::of(made.der()))
    }

    /// Brings mesh keys and notices up to date.
    fn refresh(&self, holder: &Holder, out: &Path) -> Result<Made, KeysError> {
        let mut files = vec![(NOTICES, self.papers.to_text())];
        match holder {
            Holder::Robot(_) => files.push((MESH_KEYS, self.keys.to_text())),
            // An operator speaks with agents, never on the mesh.
            Holder::Operator { .. } => {}
        }
        let mut made = Made::There;
        for (name, text) in files {
            let path = out.join(name);
            if fs::read_to_string(&path).ok().as_deref() != Some(text.as_str()) {
                write_private(&path, &text)?;
                made = Made::Refreshed;
            }
        }
        Ok(made)
    }

    fn place(&self, holder: &Holder) -> PathBuf {
        let kind = match holder {
            Holder::Robot(_) => "robot",
            Holder::Operator { .. } => "operator",
        };
        self.folder.join("issued").join(kind).join(format!("{}.crt", holder.name()))
    }
}

fn is_certificate(path: &Path) -> bool {
    path.extension().is_some_and(|extension| extension == "crt")
}

fn is_empty(folder: &Path) -> bool {
    match fs::read_dir(folder) {
        Ok(mut entries) => entries.next().is_none(),
        Err(error) => error.kind() == std::io::ErrorKind::NotFound,
    }
}

/// Which certificate a folder holds, when it holds one.
fn fingerprint_in(folder: &Path) -> Result<Option<Fingerprint>, KeysError> {
    let path = folder.join(OWN_CERTIFICATE);
    if !path.exists() {
        return Ok(None);
    }
    let text = read_text(&path)?;
    let certificate = CertificateDer::from_pem_slice(text.as_bytes()).ok();
    Ok(certificate.map(|certificate| Fingerprint::of(&certificate)))
}
