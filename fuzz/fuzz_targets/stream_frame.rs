//! What comes over streams between robots: requests, answers, deliveries of keys.
#![no_main]

use std::sync::LazyLock;
use std::time::Duration;

use libfuzzer_sys::fuzz_target;
use sdr_core::id::RobotId;
use sdr_fuzz::{bytes::Choices, meter};
use sdr_keys::{
    Delivery, Identity, Trust,
    authority::Authority,
    stream::{REQUEST_BYTES_MAX, Request, Status},
};

struct Fleet {
    trust: Trust,
    /// What the authority says, as JSON.
    genuine: Vec<u8>,
}

/// One authority for all inputs; its keys are chance, and no input depends on them.
static FLEET: LazyLock<Fleet> = LazyLock::new(|| {
    let folder = tempfile::tempdir().expect("a folder");
    let fleet = RobotId::new("moon").expect("a name");
    let wall = Duration::from_secs(1_750_000_000);
    let (mut authority, _) =
        Authority::init(&folder.path().join("authority"), &fleet, wall).expect("an authority");
    let robot = RobotId::new("robot-1").expect("a name");
    let keys = folder.path().join("robot-1");
    authority.add_robot(&robot, &keys).expect("a robot");
    authority.revoke("robot-1").expect("revoked");
    let delivery = Delivery::new(authority.newest_key(), authority.papers());
    let genuine = serde_json::to_vec(&delivery).expect("plain data");
    let own = Identity::load(&keys, wall).expect("its keys");
    Fleet { trust: own.trust().clone(), genuine }
});

fn deliver(text: &[u8]) -> bool {
    let allowed = 64 * 1024 + 16 * text.len();
    meter::at_most(allowed, || {
        let delivery = serde_json::from_slice::<Delivery>(text);
        delivery.is_ok_and(|delivery| delivery.open(&FLEET.trust).is_ok())
    })
}

fuzz_target!(|bytes: &[u8]| {
    if let Ok(request) = Request::decode(bytes) {
        assert!(bytes.len() <= REQUEST_BYTES_MAX);
        assert_eq!(request.encode(), bytes);
    }
    let mut choices = Choices(bytes);
    let status = Status::of_byte(choices.byte());
    assert!(matches!(Status::of_byte(status.byte()), again if again == status));
    deliver(bytes);
    // genuine words, changed in one place
    let mut changed = FLEET.genuine.clone();
    assert!(deliver(&changed), "the authority's own words");
    let at = usize::from(choices.short()) % changed.len();
    match choices.byte() % 3 {
        0 => changed[at] ^= choices.byte(),
        1 => drop(changed.splice(at..at, choices.rest().iter().copied())),
        _ => changed.truncate(at),
    }
    deliver(&changed);
});
