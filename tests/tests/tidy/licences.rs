//! Whose code we build in, and under which terms.

use super::{
    spdx::is_met,
    tree::{expect_none, metadata},
};

/// Terms that let anybody ship a robot with a closed component on it.
const ALLOWED: [&str; 12] = [
    "0BSD",
    "Apache-2.0",
    "BSD-2-Clause",
    "BSD-3-Clause",
    "BSL-1.0",
    "CC0-1.0",
    "ISC",
    "MIT",
    "MPL-2.0",
    "Unicode-3.0",
    "Unlicense",
    "Zlib",
];

/// Crates that must not come in, not even through others; each with what to take instead.
const BANNED: [(&str, &str); 10] = [
    ("serde_yml", "unsound and left by its author: serde-saphyr"),
    ("libyml", "unsound and left by its author: serde-saphyr"),
    ("serde_yaml", "archived, and has no positions for most errors: serde-saphyr"),
    ("openssl", "a C library on every robot: rustls"),
    ("openssl-sys", "a C library on every robot: rustls"),
    ("native-tls", "a C library on every robot: rustls"),
    ("aws-lc-rs", "needs cmake and a C toolchain for each target: ring"),
    ("aws-lc-sys", "needs cmake and a C toolchain for each target: ring"),
    ("evalexpr", "AGPL: cel"),
    ("chitchat", "datagrams of 64 kB, clock and sockets inside: crates/sdr-core/src/mesh"),
];

#[test]
fn every_dependency_has_a_licence_that_we_may_ship() {
    let allowed = |name: &str| ALLOWED.contains(&name);
    let mut findings = Vec::new();
    for package in metadata().packages {
        let met = package.license.as_ref().is_some_and(|licence| is_met(licence, &allowed));
        if !met {
            let licence = package.license.as_deref().unwrap_or("no licence named");
            findings.push(format!("{} {}: {licence}", package.name, package.version));
        }
    }
    expect_none("licences that are not on the list", &findings);
}

#[test]
fn no_banned_crate_comes_in() {
    let mut findings = Vec::new();
    for package in metadata().packages {
        for (banned, instead) in BANNED {
            if package.name.as_str() == banned {
                findings.push(format!("{banned} {}: {instead}", package.version));
            }
        }
    }
    expect_none("banned crates; `cargo tree -i NAME` says who brings them", &findings);
}
