//! The header is that of the sources.

use std::path::Path;

/// `TAUTSCOPE_WRITE_HEADER=1 cargo test -p tautscope-ffi header` writes it.
#[test]
fn header_is_generated_from_these_sources() {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR"));
    let config = cbindgen::Config::from_file(folder.join("cbindgen.toml")).unwrap();
    let mut builder = cbindgen::Builder::new().with_config(config);
    // By file: `cargo metadata` would be run for the crate.
    // In the order of the header.
    for file in [
        "types",
        "names",
        "result",
        "reduction",
        "image_update",
        "measurement",
        "supervision",
        "detector",
        "article",
    ] {
        builder = builder.with_src(folder.join(format!("src/{file}.rs")));
    }
    let mut header = Vec::new();
    builder.generate().unwrap().write(&mut header);
    let header = String::from_utf8(header).unwrap();
    let path = folder.join("include/tautscope.h");
    if std::env::var_os("TAUTSCOPE_WRITE_HEADER").is_some() {
        std::fs::write(&path, &header).unwrap();
    }
    let committed = std::fs::read_to_string(&path).unwrap_or_default();
    assert!(
        header == committed,
        "{} is old: TAUTSCOPE_WRITE_HEADER=1 cargo test -p tautscope-ffi header",
        path.display()
    );
}
