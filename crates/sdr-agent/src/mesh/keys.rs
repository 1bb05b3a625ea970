//! This robot's keys: who it is, the mesh keys it has, who is denied.

use std::fmt;
use std::path::PathBuf;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::time::Duration;

use rand::TryRngCore as _;
use rand::rngs::OsRng;
use sdr_files::robot::{RobotConfig, Seal as SealWish};
use sdr_keys::seal::{Begin, Seal, SealCounters};
use sdr_keys::tls::{Gate, OnRefusal, Standing};
use sdr_keys::{Delivery, DeliveryError, Holder, Identity, KeyId, KeysError, Keyset, Trust};
use thiserror::Error;
use tokio::sync::watch;

use crate::clock;
use crate::events::Events;
use crate::trouble::{Kind, Trouble};

/// Why the keys of robot.toml cannot be used. The operator can mend it.
#[derive(Debug, Error)]
pub(crate) enum KeysRefused {
    /// A file of theirs.
    #[error("keys: {0}")]
    Folder(#[from] KeysError),
    /// They are somebody else's.
    #[error("keys: {} holds the keys of {found}; robot.toml says robot/{robot} of fleet {fleet}", folder.display())]
    Others {
        /// The folder.
        folder: PathBuf,
        /// Whose they are.
        found: String,
        /// As robot.toml says.
        robot: String,
        /// As robot.toml says, else that of the keys.
        fleet: String,
    },
}

/// Why a delivered key is not taken.
#[derive(Debug, Error)]
pub(crate) enum NotLearned {
    /// It is none.
    #[error("{0}")]
    Delivery(#[from] DeliveryError),
    /// It is not on the disk, and so would be forgotten.
    #[error("not stored, and so not taken: {0}")]
    Disk(#[from] KeysError),
}

/// What a delivery changed.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Learned {
    /// A newer key.
    News,
    /// Nothing.
    Known,
}

/// The keys of this robot; cheap to clone.
#[derive(Clone)]
pub(crate) struct FleetKeys(Arc<Inner>);

struct Inner {
    identity: Identity,
    gate: Arc<Gate>,
    seal: Mutex<Seal>,
    set: Mutex<Keyset>,
    /// Held while a key goes to the disk, which may take long; `set` never is.
    learning: Mutex<()>,
    newest: watch::Sender<KeyId>,
    /// Where keys that were learned are kept.
    folder: PathBuf,
    events: Events,
    trouble: Trouble,
}

impl FleetKeys {
    /// The keys that robot.toml names; `None` when it asks for a plain mesh.
    pub(crate) fn open(
        robot: &RobotConfig,
        events: &Events,
        trouble: &Trouble,
    ) -> Result<Option<Self>, KeysRefused> {
        let SealWish::Keys(folder) = &robot.mesh.seal else { return Ok(None) };
        let identity = Identity::load(folder, clock::wall())?;
        let fleet = robot.mesh.fleet.as_deref().unwrap_or(identity.fleet());
        if *identity.holder() != Holder::Robot(robot.name.clone()) || fleet != identity.fleet() {
            return Err(KeysRefused::Others {
                folder: folder.clone(),
                found: format!("{} of fleet {}", identity.holder(), identity.fleet()),
                robot: robot.name.to_string(),
                fleet: fleet.into(),
            });
        }
        let given = Keyset::load(folder, identity.trust())?;
        let learned = robot.storage.state.join("keys");
        let set = match Keyset::load_saved(&learned, identity.trust()) {
            Ok(Some(saved)) if saved.newest() > given.newest() => saved,
            Ok(_) => given,
            // What the mesh taught once, it teaches again.
            Err(error) => {
                tracing::error!(event = "keys-forgotten", %error, next = "the given ones");
                given
            }
        };
        say_standing(&identity, &set, events);
        let denied = set.papers().denied().clone();
        let seal = Seal::new(
            set.keys().iter().cloned(),
            robot.mesh.key_grace,
            clock::now(),
            Box::new(|bytes| {
                OsRng.try_fill_bytes(bytes).expect("the kernel always has randomness after boot");
            }),
        );
        Ok(Some(Self(Arc::new(Inner {
            gate: Arc::new(Gate::new(identity.trust(), denied)),
            identity,
            seal: Mutex::new(seal),
            newest: watch::Sender::new(set.newest()),
            set: Mutex::new(set),
            learning: Mutex::new(()),
            folder: learned,
            events: events.clone(),
            trouble: trouble.clone(),
        }))))
    }

    /// Takes a newer key with its papers: on the disk first, then for opening datagrams. Waits
    /// for the disk: not for the loop's thread.
    pub(crate) fn learn(
        &self,
        delivery: &Delivery,
        begin: Begin,
        from: &str,
    ) -> Result<Learned, NotLearned> {
        let received = delivery.open(self.trust())?;
        let _one_at_a_time = self.0.learning.lock().unwrap_or_else(PoisonError::into_inner);
        let mut grown = self.set().clone();
        let key = received.key.clone();
        if !grown.take(received) {
            return Ok(Learned::Known);
        }
        grown.save(&self.0.folder)?;
        *self.set() = grown.clone();
        for denial in grown.papers().denied().iter() {
            if self.0.gate.deny(denial.clone()) {
                let holder = &denial.denial().holder;
                let said = format!("{holder} is denied; {from} says so, signed by the authority");
                let number = f64::from(denial.denial().number);
                let event = self.0.events.new_event("certificate-denied", said);
                self.0.events.publish(event.number("denial", number));
            }
        }
        self.seal().add_key(clock::now(), key.clone(), begin);
        let said = format!("mesh key {} from {from}", key.id());
        let event = self.0.events.new_event("key-learned", said);
        self.0.events.publish(event.number("key", f64::from(key.id().0)));
        self.0.newest.send_replace(key.id());
        Ok(Learned::News)
    }

    /// The newest key, for somebody who may have it.
    pub(crate) fn delivery(&self) -> Delivery {
        self.set().delivery()
    }

    /// The signed line that names the newest key.
    pub(crate) fn notice(&self) -> String {
        self.set().papers().notice().line().to_owned()
    }

    /// The newest key's number, and whenever it grows.
    pub(crate) fn newest(&self) -> watch::Receiver<KeyId> {
        self.0.newest.subscribe()
    }

    /// How many certificates are denied.
    pub(crate) fn denied(&self) -> usize {
        self.0.gate.denied().len()
    }

    /// Seals and opens datagrams.
    pub(crate) fn seal(&self) -> MutexGuard<'_, Seal> {
        self.0.seal.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// What was opened and refused.
    pub(crate) fn counters(&self) -> SealCounters {
        self.seal().counters(clock::now())
    }

    /// Who this robot is.
    pub(crate) fn identity(&self) -> &Identity {
        &self.0.identity
    }

    /// The authority of the fleet.
    pub(crate) fn trust(&self) -> &Trust {
        self.0.identity.trust()
    }

    /// Who may connect.
    pub(crate) fn gate(&self) -> Arc<Gate> {
        self.0.gate.clone()
    }

    /// Counts who is not let in; `door` names where.
    pub(crate) fn on_refusal(&self, door: &'static str) -> OnRefusal {
        let trouble = self.0.trouble.clone();
        Arc::new(move |refused| {
            trouble.count(Kind::CertificateRefused, &format!("{door}: {refused}"));
        })
    }

    fn set(&self) -> MutexGuard<'_, Keyset> {
        self.0.set.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

impl fmt::Debug for FleetKeys {
    /// Without keys.
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "FleetKeys({:?})", self.0.identity)
    }
}

/// What an operator should know of the own certificate.
fn say_standing(identity: &Identity, set: &Keyset, events: &Events) {
    let said = match identity.standing() {
        Standing::InTime => None,
        Standing::Expired => Some("the own certificate's time is over, by this robot's clock"),
        Standing::NotYet => Some("the own certificate's time has not come, by this robot's clock"),
    };
    if let Some(said) = said {
        let said =
            format!("{said} ({} s since 1970); it counts all the same", seconds(clock::wall()));
        events.publish(events.new_event("certificate-out-of-time", said));
    }
    if set.papers().denied().holder_of(&identity.fingerprint()).is_some() {
        let said = "the own certificate was revoked: no robot gives this one a new key";
        events.publish(events.new_event("certificate-denied", said));
    }
}

fn seconds(duration: Duration) -> u64 {
    duration.as_secs()
}
