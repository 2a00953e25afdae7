//! Embeds the atlases that are there, under the names of their files.

use std::{env, error::Error, fmt::Write as _, fs, path::Path};

fn main() -> Result<(), Box<dyn Error>> {
    let folder = Path::new(&env::var("CARGO_MANIFEST_DIR")?).join("atlases");
    println!("cargo::rerun-if-changed={}", folder.display());
    let mut paths = Vec::new();
    // Without the folder, there are no atlases to embed, and a server builds its own.
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
    fs::write(Path::new(&env::var("OUT_DIR")?).join("atlases.rs"), table)?;
    Ok(())
}
