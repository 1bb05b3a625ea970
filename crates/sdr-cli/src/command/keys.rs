//! `sdr keys`: the fleet's authority on this machine, folders for robots and operators.

use std::{
    path::{Path, PathBuf},
    process::ExitCode,
    time::{Duration, SystemTime, UNIX_EPOCH},
};

use clap::{Subcommand, ValueEnum};
use sdr_core::id::RobotId;
use sdr_keys::{
    Delivery, DeliveryAnswer, KeysError, Role,
    authority::{Authority, Issued, Made},
};
use serde::Serialize;

use crate::{
    Session,
    client::{self, Client},
    failure::Failure,
    output::Format,
};

/// Arguments of `sdr keys`.
#[derive(Debug, clap::Args)]
pub(crate) struct KeysArgs {
    /// Folder of the fleet's authority [default: sdr/authority below ~/.config]
    #[arg(long, global = true, env = "SDR_AUTHORITY", value_name = "DIR", hide_env_values = true)]
    authority: Option<PathBuf>,
    #[command(subcommand)]
    command: KeysCommand,
}

#[derive(Debug, Subcommand)]
enum KeysCommand {
    /// Make the authority of a fleet, on this machine
    Init {
        /// The fleet's name, as `fleet` below `mesh` in robot.toml has it
        #[arg(long, default_value = "fleet")]
        fleet: RobotId,
    },
    /// Make a robot's folder, or bring newer keys into it
    Add {
        /// The robot's name
        robot: RobotId,
        /// The folder, to be copied to the robot [default: ./keys-ROBOT]
        #[arg(long, value_name = "DIR")]
        out: Option<PathBuf>,
    },
    /// Make an operator's folder, for `sdr --agent ROBOT:PORT --keys DIR`
    Operator {
        /// The operator's name
        name: RobotId,
        /// What it may do
        #[arg(long, value_enum)]
        role: RoleWord,
        /// The folder [default: ./keys-NAME]
        #[arg(long, value_name = "DIR")]
        out: Option<PathBuf>,
    },
    /// Take a certificate back, and make a new mesh key
    Revoke {
        /// NAME, or robot/NAME, or operator/NAME
        name: String,
    },
    /// Make a new mesh key
    Rotate,
    /// Tell one agent the newest key and who is revoked; it tells the fleet
    Push,
    /// List certificates and the newest mesh key
    Show,
}

/// What an operator may do.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
enum RoleWord {
    /// Look, change nothing
    View,
    /// Also deploy, undeploy and push keys
    Operate,
}

/// What `-o json` prints of the authority.
#[derive(Debug, Serialize)]
struct AuthorityReport {
    fleet: String,
    authority: PathBuf,
    newest_key: u16,
    changed: bool,
}

/// What `-o json` prints of a folder.
#[derive(Debug, Serialize)]
struct IssuedReport {
    holder: String,
    folder: PathBuf,
    fingerprint: String,
    /// `new`, `refreshed` or `there`.
    made: &'static str,
}

/// What `-o json` prints of a revocation.
#[derive(Debug, Serialize)]
struct RevokedReport {
    holder: String,
    denial: u32,
    newest_key: u16,
    changed: bool,
}

/// What `sdr keys show -o json` prints.
#[derive(Debug, Serialize)]
struct ShowReport {
    fleet: String,
    authority: PathBuf,
    newest_key: u16,
    certificates: Vec<CertificateReport>,
}

#[derive(Debug, Serialize)]
struct CertificateReport {
    holder: String,
    fingerprint: String,
    revoked: bool,
}

/// One of them.
pub(crate) async fn run(args: KeysArgs, session: &Session) -> Result<ExitCode, Failure> {
    let place = match args.authority {
        Some(place) => place,
        None => default_place()?,
    };
    match args.command {
        KeysCommand::Init { fleet } => init(&place, &fleet, session)?,
        KeysCommand::Add { robot, out } => {
            let out = out.unwrap_or_else(|| format!("keys-{robot}").into());
            let issued = open(&place)?.add_robot(&robot, &out)?;
            let next = format!(
                "next: copy {} to the robot, for example as /etc/sdr/keys, and name it in robot.toml: [mesh] keys = \"/etc/sdr/keys\"",
                out.display()
            );
            tell_issued(&issued, &next, session)?;
        }
        KeysCommand::Operator { name, role, out } => {
            let out = out.unwrap_or_else(|| format!("keys-{name}").into());
            let role = match role {
                RoleWord::View => Role::View,
                RoleWord::Operate => Role::Operate,
            };
            let issued = open(&place)?.add_operator(&name, role, &out)?;
            let next = format!("next: sdr --agent ROBOT:7601 --keys {} status", out.display());
            tell_issued(&issued, &next, session)?;
        }
        KeysCommand::Revoke { name } => revoke(&place, &name, session)?,
        KeysCommand::Rotate => {
            let mut authority = open(&place)?;
            authority.rotate()?;
            tell_authority(&authority, Made::Refreshed, session)?;
        }
        KeysCommand::Push => push(&place, session).await?,
        KeysCommand::Show => show(&place, session)?,
    }
    Ok(ExitCode::SUCCESS)
}

fn init(place: &Path, fleet: &RobotId, session: &Session) -> Result<(), Failure> {
    let (authority, made) = Authority::init(place, fleet, now())?;
    tell_authority(&authority, made, session)
}

fn open(place: &Path) -> Result<Authority, Failure> {
    Ok(Authority::open(place, now())?)
}

fn revoke(place: &Path, name: &str, session: &Session) -> Result<(), Failure> {
    let mut authority = open(place)?;
    let revoked = authority.revoke(name)?;
    let newest_key = authority.newest_key().id().0;
    let holder = revoked.holder.to_string();
    match session.output.format() {
        Format::Json => session.output.json(&RevokedReport {
            holder,
            denial: revoked.denial,
            newest_key,
            changed: revoked.rotated_to.is_some(),
        }),
        Format::Text if revoked.rotated_to.is_none() => {
            session.output.line(&format!("{holder}: revoked before, nothing changed"))
        }
        Format::Text => session.output.line(&format!(
            "{holder}: revoked; the mesh key is now {newest_key}\n  the fleet does not know yet.  next: sdr keys push"
        )),
    }
}

/// Tells one agent; the fleet learns it from there.
async fn push(place: &Path, session: &Session) -> Result<(), Failure> {
    let delivery = {
        let authority = open(place)?;
        Delivery::new(authority.newest_key(), authority.papers())
    };
    let answer: DeliveryAnswer = Client::of(session)?.post("/v1/keys", &delivery).await?;
    match session.output.format() {
        Format::Json => session.output.json(&answer),
        Format::Text => {
            let DeliveryAnswer { robot, newest_key, denied, changed } = answer;
            let news = if changed { "taken" } else { "known before" };
            session.output.line(&format!(
                "{robot}: mesh key {newest_key} and {denied} revoked certificates, {news}; the others learn it from there"
            ))
        }
    }
}

fn show(place: &Path, session: &Session) -> Result<(), Failure> {
    let authority = open(place)?;
    let overview = authority.overview()?;
    let certificates = overview.issued.iter().map(|certificate| CertificateReport {
        holder: certificate.holder.to_string(),
        fingerprint: certificate.fingerprint.to_string(),
        revoked: certificate.denial.is_some(),
    });
    let report = ShowReport {
        fleet: overview.fleet.clone(),
        authority: place.into(),
        newest_key: overview.newest_key.0,
        certificates: certificates.collect(),
    };
    if session.output.format() == Format::Json {
        return session.output.json(&report);
    }
    session.output.line(&format!(
        "fleet {}  mesh key {}  authority {}",
        report.fleet,
        report.newest_key,
        place.display()
    ))?;
    for CertificateReport { holder, fingerprint, revoked } in &report.certificates {
        let note = if *revoked { "revoked" } else { "" };
        let line = format!("{holder:<24} {}  {note}", &fingerprint[..16]);
        session.output.line(line.trim_end())?;
    }
    if report.certificates.is_empty() {
        session.output.line("no certificates yet.  next: sdr keys add ROBOT")?;
    }
    Ok(())
}

fn tell_authority(authority: &Authority, made: Made, session: &Session) -> Result<(), Failure> {
    let newest_key = authority.newest_key().id().0;
    let (fleet, place) = (authority.fleet().to_owned(), authority.folder().to_path_buf());
    if session.output.format() == Format::Json {
        let changed = made != Made::There;
        return session.output.json(&AuthorityReport {
            fleet,
            authority: place,
            newest_key,
            changed,
        });
    }
    let place = place.display();
    session.output.line(&match made {
        Made::New => format!(
            "authority of fleet {fleet} made in {place}: keep it on this machine, and a copy elsewhere\n  next: sdr keys add ROBOT   for each robot\n        sdr keys operator NAME --role operate   for yourself"
        ),
        Made::There => format!("authority of fleet {fleet} is in {place}; nothing changed"),
        Made::Refreshed => format!(
            "fleet {fleet}: the mesh key is now {newest_key}; the fleet does not know yet.  next: sdr keys push"
        ),
    })
}

fn tell_issued(issued: &Issued, next: &str, session: &Session) -> Result<(), Failure> {
    let made = match issued.made {
        Made::New => "new",
        Made::Refreshed => "refreshed",
        Made::There => "there",
    };
    let (holder, folder) = (issued.holder.to_string(), issued.folder.clone());
    if session.output.format() == Format::Json {
        let fingerprint = issued.fingerprint.to_string();
        return session.output.json(&IssuedReport { holder, folder, fingerprint, made });
    }
    let place = folder.display();
    session.output.line(&match issued.made {
        Made::New => format!("{holder}: {place} holds its certificate and secret key\n  {next}"),
        Made::Refreshed => {
            format!("{holder}: {place} has the newest keys and notices now\n  {next}")
        }
        Made::There => format!("{holder}: {place} is up to date; nothing changed"),
    })
}

fn default_place() -> Result<PathBuf, Failure> {
    client::user_folder("authority").ok_or_else(|| {
        Failure::Usage("neither HOME nor XDG_CONFIG_HOME is set; say --authority DIR".into())
    })
}

fn now() -> Duration {
    SystemTime::now().duration_since(UNIX_EPOCH).unwrap_or_default()
}

impl From<KeysError> for Failure {
    fn from(error: KeysError) -> Self {
        Self::new(format!("keys: {error}"))
    }
}
