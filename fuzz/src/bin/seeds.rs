//! Writes the seed corpora, from real values: `seeds FOLDER`. Small; the fuzzer does the rest.

#[path = "seeds/values.rs"]
mod values;

// What asks for coverage is linked into everything here, and libFuzzer is what is asked.
use libfuzzer_sys as _;

use std::fs;
use std::path::{Path, PathBuf};

use sdr_core::disk;
use sdr_fuzz::bytes::{Choices, put_slice};
use sdr_fuzz::recordings;

fn main() -> std::io::Result<()> {
    let folder = std::env::args_os().nth(1).map_or_else(|| PathBuf::from("corpus"), PathBuf::from);
    let texts = Path::new(env!("CARGO_MANIFEST_DIR")).join("..");
    for (target, seeds) in [
        ("mesh_datagram", values::talk()),
        ("mesh_state", mesh_state()),
        ("sealed_datagram", sealed()),
        ("stream_frame", values::requests()),
        ("api_request", values::bodies(&texts)),
        ("stored_state", stored(&texts)),
        ("component_line", values::lines()),
        ("record_value", records(&texts)),
        ("files_yaml", values::yaml(&texts)?),
        ("files_toml", values::toml()),
        ("recording", recordings()),
    ] {
        let place = folder.join(target);
        fs::create_dir_all(&place)?;
        for (number, seed) in seeds.iter().enumerate() {
            fs::write(place.join(format!("seed-{number:03}")), seed)?;
        }
    }
    Ok(())
}

/// What robots really said, as raw datagrams of the target's steps.
fn mesh_state() -> Vec<Vec<u8>> {
    let talk = values::talk();
    let chunks = talk.chunks(8).map(|chunk| {
        let mut seed = Vec::new();
        for (number, datagram) in chunk.iter().enumerate() {
            seed.push(u8::try_from(number % 5 + 1).expect("small") << 4 | 1);
            put_slice(datagram, &mut seed);
            seed.extend([0, 9]);
        }
        seed
    });
    chunks.collect()
}

/// Each step of the target once, and a whole exchange.
fn sealed() -> Vec<Vec<u8>> {
    let mut exchange = Vec::new();
    for step in [1, 1, 4, 3, 5, 6, 1, 2, 7] {
        exchange.push(step);
        match step {
            1 | 2 => put_slice(b"sixteen bytes and some more of them", &mut exchange),
            3 => {
                put_slice(b"sixteen bytes and some more", &mut exchange);
                exchange.extend([20, 0, 1]);
            }
            4 | 6 => exchange.push(1),
            5 => exchange.extend([10, 0]),
            _ => {
                exchange.extend([0, 1, 2, 9, 0, 3]);
                put_slice(&[2; 16], &mut exchange);
            }
        }
    }
    vec![exchange, vec![0, 3, 0, 1, 2, 3]]
}

fn stored(texts: &Path) -> Vec<Vec<u8>> {
    let state = values::state(texts);
    let file = disk::encode(&state);
    let content = postcard::to_allocvec(&state).expect("plain data");
    vec![[&[0][..], &file].concat(), [&[1][..], &content].concat()]
}

/// A message of each type, in one file; a file as it lies there.
fn recordings() -> Vec<Vec<u8>> {
    let mut chosen = Vec::new();
    for kind in 0..recordings::TYPES.len() {
        chosen.extend([u8::try_from(kind).expect("few"), 9, 0, 20]);
        put_slice(&values::recorded(kind), &mut chosen);
    }
    let file = recordings::file(&mut Choices(&chosen));
    vec![[&[1][..], &chosen].concat(), [&[0][..], &file].concat()]
}

/// The records of a system as the target reads them.
fn records(texts: &Path) -> Vec<Vec<u8>> {
    let state = values::state(texts);
    let facts: Vec<_> = state.fleet.iter().collect();
    let chunks = facts.chunks(6).map(|chunk| {
        let mut seed = Vec::new();
        for fact in chunk {
            let record = fact.record();
            seed.push(record.key.kind.0);
            if record.key.kind == sdr_core::record::RecordKind::COMPONENT {
                seed.push(u8::from(record.key.name.ends_with("anomaly")));
            }
            let epoch = if record.version.epoch.is_some() { 5 } else { 0 };
            seed.extend([epoch, 1, 1, 1]);
            put_slice(&record.value, &mut seed);
        }
        seed
    });
    chunks.collect()
}
