//! An authority in a folder, what it issues, and who then gets in.

use std::{os::unix::fs::PermissionsExt as _, sync::Arc, time::Duration};

use rustls::{ClientConnection, ServerConnection, pki_types::ServerName};

use super::*;
use crate::{
    Identity,
    tls::{self, Gate, Refused, Standing, Wanted},
};

fn wall() -> Duration {
    Duration::from_secs(1_795_000_000)
}

fn name(word: &str) -> RobotId {
    RobotId::new(word).unwrap()
}

struct Bench {
    home: tempfile::TempDir,
    authority: Authority,
}

impl Bench {
    fn new() -> Self {
        let home = tempfile::tempdir().unwrap();
        let folder = home.path().join("authority");
        let (authority, made) = Authority::init(&folder, &name("moon"), wall()).unwrap();
        assert_eq!(made, Made::New);
        Self { home, authority }
    }

    fn out(&self, word: &str) -> PathBuf {
        self.home.path().join(word)
    }

    fn robot(&self, word: &str) -> Identity {
        let out = self.out(word);
        self.authority.add_robot(&name(word), &out).unwrap();
        Identity::load(&out, wall()).unwrap()
    }

    fn operator(&self, word: &str, role: crate::Role) -> Identity {
        let out = self.out(word);
        self.authority.add_operator(&name(word), role, &out).unwrap();
        Identity::load(&out, wall()).unwrap()
    }

    fn gate(&self) -> Arc<Gate> {
        Arc::new(Gate::new(&self.authority.trust, self.authority.papers().denied().clone()))
    }
}

/// What each end says of a handshake: client, server.
fn shake(
    client: &Identity,
    (server, gate, wanted): (&Identity, Arc<Gate>, Wanted),
) -> (Result<(), String>, Result<(), String>) {
    let quiet: tls::OnRefusal = Arc::new(|_: &Refused| {});
    let own = Arc::new(Gate::new(client.trust(), DenyList::default()));
    let config = tls::client(client, own, b"x", quiet.clone());
    let to = ServerName::try_from("robot").unwrap();
    let mut calling = ClientConnection::new(Arc::new(config), to).unwrap();
    let config = tls::server(server, gate, wanted, b"x", quiet);
    let mut called = ServerConnection::new(Arc::new(config)).unwrap();
    let (mut client_said, mut server_said) = (Ok(()), Ok(()));
    for _ in 0..4 {
        let mut bytes = Vec::new();
        while calling.wants_write() {
            calling.write_tls(&mut bytes).unwrap();
        }
        let mut rest = bytes.as_slice();
        while !rest.is_empty() && server_said.is_ok() {
            called.read_tls(&mut rest).unwrap();
            let processed = called.process_new_packets().map(drop);
            server_said = processed.map_err(|error| tls::explain_tls(&error, server.holder()));
        }
        let mut bytes = Vec::new();
        while called.wants_write() {
            called.write_tls(&mut bytes).unwrap();
        }
        let mut rest = bytes.as_slice();
        while !rest.is_empty() && client_said.is_ok() {
            calling.read_tls(&mut rest).unwrap();
            let processed = calling.process_new_packets().map(drop);
            client_said = processed.map_err(|error| tls::explain_tls(&error, client.holder()));
        }
    }
    assert!(server_said.is_err() || !called.is_handshaking());
    (client_said, server_said)
}

#[test]
fn doing_it_again_changes_nothing_and_another_fleet_is_refused() {
    let Bench { home, authority } = Bench::new();
    let folder = authority.folder().to_path_buf();
    let busy = Authority::open(&folder, wall()).unwrap_err().to_string();
    assert!(busy.contains("another `sdr keys` works there"), "{busy}");
    drop(authority);

    let (again, made) = Authority::init(&folder, &name("moon"), wall()).unwrap();

    assert_eq!((made, again.newest_key().id()), (Made::There, KeyId(1)));
    drop(again);
    let error = Authority::init(&folder, &name("mars"), wall()).unwrap_err().to_string();
    assert!(error.contains("the authority of fleet `moon` is there"), "{error}");
    let mode = |path: &Path| std::fs::metadata(path).unwrap().permissions().mode() & 0o777;
    assert_eq!((mode(&folder), mode(&folder.join(KEY))), (0o700, 0o600));
    drop(home);
}

#[test]
fn a_robot_is_added_once_and_refreshed_afterwards() {
    let mut bench = Bench::new();
    let out = bench.out("robot-1");
    let first = bench.authority.add_robot(&name("robot-1"), &out).unwrap();
    let again = bench.authority.add_robot(&name("robot-1"), &out).unwrap();
    bench.authority.rotate().unwrap();
    let later = bench.authority.add_robot(&name("robot-1"), &out).unwrap();

    assert_eq!([first.made, again.made, later.made], [Made::New, Made::There, Made::Refreshed]);
    assert_eq!(first.fingerprint, later.fingerprint);
    let trust = &bench.authority.trust;
    let set = crate::Keyset::load(&out, trust).unwrap();
    assert_eq!(set.newest(), KeyId(2));
    assert_eq!(set.delivery().open(trust).unwrap().papers, *bench.authority.papers());
    let elsewhere = bench.authority.add_robot(&name("robot-1"), &bench.out("other"));
    let error = elsewhere.unwrap_err().to_string();
    assert!(error.contains("robot/robot-1 has a certificate, and it is not in here"), "{error}");
    let taken = bench.authority.add_robot(&name("robot-2"), &out).unwrap_err().to_string();
    assert!(taken.contains("there are files in it"), "{taken}");
}

#[test]
fn robots_meet_robots_and_operators_meet_the_api() {
    let bench = Bench::new();
    let (one, two) = (bench.robot("robot-1"), bench.robot("robot-2"));
    let anna = bench.operator("anna", crate::Role::View);

    assert_eq!(shake(&one, (&two, bench.gate(), Wanted::Robot)), (Ok(()), Ok(())));
    assert_eq!(shake(&anna, (&two, bench.gate(), Wanted::Operator)), (Ok(()), Ok(())));
    let (client, server) = shake(&one, (&two, bench.gate(), Wanted::Operator));
    assert_eq!(client.unwrap_err(), "it refused robot/robot-1: such certificates are not for this");
    assert_eq!(server.unwrap_err(), "refused here: it is not who is wanted");
    let (client, _) = shake(&anna, (&two, bench.gate(), Wanted::Robot));
    assert_eq!(client.unwrap_err(), "it refused view/anna: such certificates are not for this");
}

#[test]
fn the_revoked_are_refused_and_may_come_back_under_a_new_certificate() {
    let mut bench = Bench::new();
    let (one, two) = (bench.robot("robot-1"), bench.robot("robot-2"));

    let revoked = bench.authority.revoke("robot-1").unwrap();
    assert_eq!((revoked.denial, revoked.rotated_to), (1, Some(KeyId(2))));
    assert_eq!(bench.authority.revoke("robot/robot-1").unwrap().rotated_to, None);

    let (client, server) = shake(&one, (&two, bench.gate(), Wanted::Robot));
    assert_eq!(client.unwrap_err(), "it refused robot/robot-1: revoked");
    assert!(server.unwrap_err().contains("revoked"));
    let again = bench.out("robot-1-again");
    let issued = bench.authority.add_robot(&name("robot-1"), &again).unwrap();
    assert_eq!(issued.made, Made::New);
    let one = Identity::load(&again, wall()).unwrap();
    assert_eq!(shake(&one, (&two, bench.gate(), Wanted::Robot)), (Ok(()), Ok(())));
    let error = bench.authority.revoke("robot-9").unwrap_err().to_string();
    assert!(error.contains("no certificate of `robot-9`"), "{error}");
}

#[test]
fn another_authority_of_the_same_name_is_a_stranger() {
    let (ours, theirs) = (Bench::new(), Bench::new());
    let (one, two) = (ours.robot("robot-1"), theirs.robot("robot-2"));

    let (client, _) = shake(&one, (&two, theirs.gate(), Wanted::Robot));
    assert_eq!(client.unwrap_err(), "refused here: it shows a certificate of another authority");
    let line = theirs.authority.papers().notice().line();
    assert_eq!(one.trust().read_notice(line), Err(crate::StatementError::Signature));
}

#[test]
fn clocks_that_are_wrong_by_years_refuse_nobody() {
    let bench = Bench::new();
    let gate = bench.gate();
    bench.robot("robot-1");
    let out = bench.out("robot-1");
    let certificate = crate::trust::read_certificate(&out.join("own.crt")).unwrap();

    for (years, standing) in
        [(0, Standing::NotYet), (57, Standing::InTime), (90, Standing::Expired)]
    {
        let wall = Duration::from_secs(years * 31_556_952);
        let now = UnixTime::since_unix_epoch(wall);
        gate.admit(&certificate, &Wanted::Robot, now).unwrap();
        assert_eq!(Identity::load(&out, wall).unwrap().standing(), standing, "{years}");
    }
}

#[test]
fn an_interrupted_rotation_is_finished_by_the_next_command() {
    let Bench { home, mut authority } = Bench::new();
    let folder = authority.folder().to_path_buf();
    let before = std::fs::read_to_string(folder.join(NOTICES)).unwrap();
    authority.revoke("robot-1").unwrap_err();
    authority.rotate().unwrap();
    std::fs::write(folder.join(NOTICES), before).unwrap();
    drop(authority);

    let opened = Authority::open(&folder, wall()).unwrap();

    assert!(opened.papers().name(opened.newest_key()));
    assert_eq!(opened.papers().notice().notice().key, KeyId(2));
    drop(home);
}

#[test]
fn changed_statements_are_not_believed() {
    let mut bench = Bench::new();
    bench.robot("robot-1");
    bench.authority.revoke("robot-1").unwrap();
    let trust = &bench.authority.trust;
    let papers = bench.authority.papers();
    let text = papers.to_text();
    assert_eq!(&Papers::parse(&text, trust).unwrap(), papers);

    for (from, to) in
        [("key=2", "key=3"), ("denied=1", "denied=0"), ("robot-1", "robot-2"), ("sig=", "sig=0")]
    {
        assert!(Papers::parse(&text.replace(from, to), trust).is_err(), "{from} -> {to}");
    }
    let first = text.lines().next().unwrap();
    assert!(Papers::parse(first, trust).unwrap_err().to_string().contains("denials are missing"));
    assert!(first.len() < crate::STATEMENT_BYTES_MAX && text.lines().all(|line| line.len() < 400));
}

#[test]
fn folders_that_do_not_fit_together_are_refused_with_the_file() {
    let bench = Bench::new();
    bench.robot("robot-1");
    bench.robot("robot-2");
    let (one, two) = (bench.out("robot-1"), bench.out("robot-2"));

    std::fs::copy(two.join("own.key"), one.join("own.key")).unwrap();
    let error = Identity::load(&one, wall()).unwrap_err().to_string();
    assert!(error.contains("own.key: not the key of"), "{error}");

    std::fs::set_permissions(one.join("own.key"), std::fs::Permissions::from_mode(0o644)).unwrap();
    let error = Identity::load(&one, wall()).unwrap_err().to_string();
    assert!(error.contains("mode 644") && error.contains("chmod 600"), "{error}");

    std::fs::write(two.join("own.crt"), "hello").unwrap();
    let error = Identity::load(&two, wall()).unwrap_err().to_string();
    assert!(error.contains("own.crt: no certificate; allowed: PEM"), "{error}");

    std::fs::remove_file(two.join("fleet.crt")).unwrap();
    let error = Identity::load(&two, wall()).unwrap_err().to_string();
    assert!(error.contains("no such file; `sdr keys add ROBOT`"), "{error}");
}
