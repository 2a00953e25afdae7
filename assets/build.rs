//! Embeds the shipped grips of objects and primitives under the names of their files.

use std::{env, error::Error, fmt::Write as _, fs, path::Path};

fn main() -> Result<(), Box<dyn Error>> {
    embed("atlases")?;
    embed("primitives")
}

/// Writes a table of the folder's files.
fn embed(name: &str) -> Result<(), Box<dyn Error>> {
    let folder = Path::new(&env::var("CARGO_MANIFEST_DIR")?).join(name);
    println!("cargo::rerun-if-changed={}", folder.display());
    let mut paths = Vec::new();
    // Without the folder there is nothing to embed: servers grow all atlases, and searches do without primitives.
    if folder.is_dir() {
        for file in fs::read_dir(&folder)? {
            paths.push(file?.path());
        }
    }
    paths.retain(|path| path.extension().is_some_and(|extension| extension == "atlas"));
    paths.sort();
    let mut table = String::from("&[\n");
    for path in &paths {
        let name = path.file_stem().and_then(|name| name.to_str());
        let (name, path) = name.zip(path.to_str()).ok_or("a name that is not UTF-8")?;
        writeln!(table, "({name:?}, include_bytes!({path:?})),")?;
    }
    table.push_str("]\n");
    let table_path = Path::new(&env::var("OUT_DIR")?).join(name).with_extension("rs");
    fs::write(table_path, table)?;
    Ok(())
}
