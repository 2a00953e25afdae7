//! Writes the everyday objects into a folder, as files that the server's `objects_directory` takes, and `objects.tsv`, a
//! table of them.

use std::{path::PathBuf, process::ExitCode};

use grasp_everyday::{everyday_objects, table};

fn main() -> ExitCode {
    let mut arguments = std::env::args_os().skip(1);
    let (Some(folder), None) = (arguments.next(), arguments.next()) else {
        eprintln!("usage: grasp-everyday FOLDER");
        return ExitCode::from(2);
    };
    match write(&PathBuf::from(folder)) {
        Ok(objects) => {
            println!("wrote {objects} objects");
            ExitCode::SUCCESS
        }
        Err(error) => {
            eprintln!("error: {error}");
            ExitCode::FAILURE
        }
    }
}

/// Writes mesh and manifest of every object; returns how many objects there are.
fn write(folder: &std::path::Path) -> std::io::Result<usize> {
    std::fs::create_dir_all(folder)?;
    let objects = everyday_objects();
    for object in &objects {
        std::fs::write(folder.join(format!("{}.obj", object.name)), object.obj())?;
        std::fs::write(folder.join(format!("{}.toml", object.name)), object.manifest())?;
    }
    std::fs::write(folder.join("objects.tsv"), table(&objects))?;
    Ok(objects.len())
}
