//! The schemas in docs/schemas are those of the types.

use std::{fs, path::Path};

#[test]
fn the_committed_schemas_are_those_of_the_types() {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../docs/schemas");
    for (name, text) in sdr_files::schema::all() {
        let path = folder.join(format!("{name}.json"));
        if std::env::var_os("BLESS").is_some() {
            fs::write(&path, &text).unwrap();
        }
        let committed = fs::read_to_string(&path).unwrap_or_default();
        assert!(
            committed == text,
            "{} is old; rewrite it: BLESS=1 cargo test -p sdr-files",
            path.display()
        );
    }
}
