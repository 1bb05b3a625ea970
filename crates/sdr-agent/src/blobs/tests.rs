//! Two robots on loopback.

use std::path::Path;

use sdr_core::{blob::BlobHash, id::RobotId};
use sdr_files::RobotConfig;
use sdr_files::robot::{Places, parse_robot};
use sdr_keys::authority::Authority;
use sdr_keys::seal::Begin;
use tempfile::TempDir;

use super::*;
use crate::clock;
use crate::events::Events;
use crate::mesh::sealed::Sidings;
use crate::mesh::udp::Mesh;
use crate::trouble::Trouble;

struct Bench {
    home: TempDir,
    authority: Authority,
}

struct Robot {
    streams: Streams,
    trouble: Trouble,
    address: SocketAddr,
    _mesh: Mesh,
}

impl Bench {
    fn new() -> Self {
        let home = tempfile::tempdir().unwrap();
        let fleet = RobotId::new("moon").unwrap();
        let folder = home.path().join("authority");
        let (authority, _) = Authority::init(&folder, &fleet, clock::wall()).unwrap();
        Self { home, authority }
    }

    fn config(&self, name: &str) -> RobotConfig {
        let own = self.home.path().join(name);
        self.authority.add_robot(&RobotId::new(name).unwrap(), &own.join("keys")).unwrap();
        let places = Places {
            folder: own.clone(),
            home: None,
            host_name: name.into(),
            state: own.join("state"),
            run: own,
        };
        let text = "[mesh]\nkeys = \"keys\"\nlisten = \"127.0.0.1:0\"\n";
        parse_robot("robot.toml", text, &places).unwrap()
    }

    async fn robot(&self, name: &str) -> Robot {
        let config = self.config(name);
        let events = Events::new(config.name.clone());
        let trouble = Trouble::new(events.clone());
        let keys = FleetKeys::open(&config, &events, &trouble).unwrap().unwrap();
        let socket = Mesh::open(config.mesh.listen).await.unwrap();
        let (sender, packets) = mpsc::channel(64);
        let (hint_sender, hints) = mpsc::channel(4);
        let store = BlobStore::open(&config.storage.state, 4 << 20).unwrap();
        let streams = Streams::start(socket.clone(), packets, keys.clone(), store).unwrap();
        streams.follow_hints(hints);
        let address = socket.local_addr().unwrap();
        let sidings = Sidings { streams: sender, hints: hint_sender };
        let (inputs, _) = mpsc::channel(64);
        let mesh = Mesh::start(socket, Some((keys, sidings)), None, inputs, trouble.clone());
        Robot { streams, trouble, address, _mesh: mesh }
    }

    fn part(&self, name: &str, hash: &BlobHash) -> std::path::PathBuf {
        self.home.path().join(name).join("state/blobs").join(format!("{hash}.part"))
    }
}

/// A runtime as the agent has it.
fn run(test: impl Future<Output = ()>) {
    let runtime = tokio::runtime::Builder::new_current_thread().enable_all().build().unwrap();
    tokio::task::LocalSet::new().block_on(&runtime, test);
}

fn picture(length: usize) -> Vec<u8> {
    (0..length).map(|index| u8::try_from(index * 7 % 251).unwrap()).collect()
}

fn size(bytes: &[u8]) -> u64 {
    u64::try_from(bytes.len()).unwrap()
}

fn exists(path: &Path) -> bool {
    path.exists()
}

#[test]
fn a_blob_comes_whole_and_stays() {
    run(async {
        let bench = Bench::new();
        let (one, two) = (bench.robot("robot-1").await, bench.robot("robot-2").await);
        let bytes = picture(700_000);
        let hash = one.streams.store().put(&bytes).unwrap();

        let came = two.streams.fetch(one.address, hash, size(&bytes), Keep::Here).await.unwrap();

        assert!(came == bytes);
        assert!(two.streams.store().read(&hash).unwrap().unwrap() == bytes);
        let other = BlobHash::of(b"nobody has this");
        let error = two.streams.fetch(one.address, other, 15, Keep::Here).await.unwrap_err();
        assert!(matches!(error, FetchError::Absent(_)), "{error}");
        let error = two.streams.fetch(one.address, hash, 9, Keep::Here).await.unwrap();
        assert_eq!(error.len(), bytes.len(), "what is here needs nobody");
    });
}

#[test]
fn a_broken_transfer_goes_on_where_it_broke_and_wrong_bytes_are_forgotten() {
    run(async {
        let bench = Bench::new();
        let (one, two) = (bench.robot("robot-1").await, bench.robot("robot-2").await);
        let bytes = picture(300_000);
        let hash = one.streams.store().put(&bytes).unwrap();
        let part = bench.part("robot-2", &hash);

        two.streams.store().keep_partial(&hash, &bytes[..299_999]).unwrap();
        let came = two.streams.fetch(one.address, hash, size(&bytes), Keep::Here).await.unwrap();
        assert!(came == bytes && !exists(&part));

        let other = picture(1000);
        let hash = one.streams.store().put(&other).unwrap();
        let part = bench.part("robot-2", &hash);
        two.streams.store().keep_partial(&hash, &[0; 500]).unwrap();
        let error = two.streams.fetch(one.address, hash, 1000, Keep::Here).await.unwrap_err();
        assert!(matches!(error, FetchError::Store(StoreError::Hash { .. })), "{error}");
        assert!(!exists(&part));
        assert!(two.streams.fetch(one.address, hash, 1000, Keep::Here).await.unwrap() == other);
        let error = two.streams.fetch(one.address, BlobHash::of(b"x"), u64::MAX, Keep::Here).await;
        assert!(matches!(error, Err(FetchError::Store(StoreError::TooLarge { .. }))));
    });
}

#[test]
fn the_denied_get_neither_blobs_nor_keys() {
    run(async {
        let mut bench = Bench::new();
        let (one, two) = (bench.robot("robot-1").await, bench.robot("robot-2").await);
        let hash = one.streams.store().put(b"a blob").unwrap();
        bench.authority.revoke("robot-2").unwrap();
        let news = sdr_keys::Delivery::new(bench.authority.newest_key(), bench.authority.papers());
        one.streams.keys.learn(&news, Begin::Now, "a test").unwrap();

        let have = *two.streams.keys.newest().borrow();
        let error = two.streams.fetch_key(one.address, have).await.unwrap_err();
        assert!(matches!(error, FetchError::Unreachable { .. }), "{error}");
        let error = two.streams.fetch(one.address, hash, 6, Keep::Here).await.unwrap_err();
        assert!(matches!(error, FetchError::Unreachable { .. }), "{error}");
        assert!(one.trouble.counters()["certificates_refused"] >= 2);
    });
}

#[test]
fn a_key_is_given_to_who_lacks_it() {
    run(async {
        let mut bench = Bench::new();
        let (one, two) = (bench.robot("robot-1").await, bench.robot("robot-2").await);
        let have = *two.streams.keys.newest().borrow();
        let error = two.streams.fetch_key(one.address, have).await.unwrap_err();
        assert!(matches!(error, FetchError::Absent(_)), "{error}");

        bench.authority.rotate().unwrap();
        let news = sdr_keys::Delivery::new(bench.authority.newest_key(), bench.authority.papers());
        one.streams.keys.learn(&news, Begin::Now, "a test").unwrap();
        let delivery = two.streams.fetch_key(one.address, have).await.unwrap();
        two.streams.keys.learn(&delivery, Begin::Now, "robot-1").unwrap();

        assert_eq!(two.streams.keys.newest().borrow().0, 2);
        let config = bench.config("robot-2");
        let events = Events::new(config.name.clone());
        let again = FleetKeys::open(&config, &events, &two.trouble).unwrap().unwrap();
        assert_eq!(again.newest().borrow().0, 2, "what was learned is on the disk");
    });
}

#[test]
fn the_quota_is_kept_and_the_newest_stay() {
    let folder = tempfile::tempdir().unwrap();
    let store = BlobStore::open(folder.path(), 1000).unwrap();
    let hashes: Vec<BlobHash> =
        (0..5_u8).map(|number| store.put(&[number; 300]).unwrap()).collect();

    let kept = hashes.iter().filter(|hash| store.read(hash).unwrap().is_some()).count();
    assert_eq!(kept, 3);
    assert!(store.read(&hashes[4]).unwrap().is_some());
    assert!(matches!(store.put(&[9; 1001]), Err(StoreError::TooLarge { .. })));
    assert_eq!(BlobHash::parse(&hashes[0].to_string()), Some(hashes[0]));
    assert_eq!(BlobHash::parse("00"), None);
}
