//! Makes the grips that ship with the server, and the number that names how they grow. A rerun gives identical bytes.

mod algorithm;
mod atlases;

use std::{
    fs, io,
    path::{Path, PathBuf},
    process::ExitCode,
};

use atlases::Collection;
use clap::{Parser, ValueEnum};

/// A file of the assets: its path below the assets folder, with `/` between the parts, and its bytes.
pub(crate) type AssetFile = (String, Vec<u8>);

/// Whether products of quaternions and vectors are rounded once where a build for any processor rounds twice.
const FUSES: bool = cfg!(all(target_arch = "x86_64", target_feature = "fma"));

/// The folder that the built-in assets are embedded from.
const ASSETS: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/..");

/// Makes the grips that ship with the server.
///
/// A rerun gives identical bytes, so that the files can be traced back to the code that made them.
#[derive(Debug, Parser)]
#[command(name = "grasp-assets-generator", version)]
struct Arguments {
    /// What to make.
    #[arg(value_enum, default_value_t = Section::All)]
    section: Section,

    /// The folder to write to or to compare with.
    #[arg(long, value_name = "DIR", default_value = ASSETS)]
    out: PathBuf,

    /// With atlases: also writes the complete atlases into this folder, which a server accepts as `atlas_directory`.
    #[arg(long, value_name = "DIR", conflicts_with = "check")]
    complete: Option<PathBuf>,

    /// Writes nothing; compares with the files that are there and exits with 1 if any differs.
    #[arg(long)]
    check: bool,
}

/// A part of the assets.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
enum Section {
    /// The number that names how atlases grow, which is part of `grasp-synthesis`. Where it changes, atlases and primitives
    /// must be made again.
    Algorithm,
    /// The grips of the objects that ship with the server, for both hands of the rig adult; takes minutes. With --check,
    /// the start of growth and some grips are compared.
    Atlases,
    /// Grips of the primitives for both hands of the rig adult, for objects without an atlas; takes minutes, and is
    /// checked in the same way.
    Primitives,
    /// All of these.
    All,
}

impl Section {
    fn collections(self) -> &'static [Collection] {
        match self {
            Self::Algorithm => &[],
            Self::Atlases => &[Collection::Objects],
            Self::Primitives => &[Collection::Primitives],
            Self::All => &[Collection::Objects, Collection::Primitives],
        }
    }

    /// Makes the section's files and writes them below a folder. Complete atlases of objects go into the folder `complete`
    /// if there is one.
    fn make(self, folder: &Path, complete: Option<&Path>) -> io::Result<()> {
        if self == Self::Algorithm {
            return write(folder, &algorithm::generate());
        }
        if !algorithm::is_current() {
            let message =
                "atlases grow differently than the algorithm's number says: run the section algorithm first";
            return Err(io::Error::other(message));
        }
        for collection in self.collections() {
            let complete = complete.filter(|_| *collection == Collection::Objects);
            for file in collection.generate(complete)? {
                write(folder, &file)?;
            }
        }
        Ok(())
    }

    /// Prints every file below `folder` that is missing or not what is made now; true if there is none. Looks at every `nth`
    /// atlas only.
    fn is_current(self, folder: &Path, nth: usize) -> bool {
        let mut is_current = true;
        for collection in self.collections() {
            is_current &= collection.check(folder, nth);
        }
        if matches!(self, Self::Algorithm | Self::All) {
            let (path, made) = algorithm::generate();
            let complaint = match fs::read(folder.join(&path)) {
                Ok(found) if found == made => return is_current,
                Ok(_) => "differs".to_owned(),
                Err(error) => format!("cannot be read: {error}"),
            };
            println!("{path}: {complaint}");
            is_current = false;
        }
        is_current
    }
}

fn main() -> ExitCode {
    let Arguments {
        section,
        out,
        complete,
        check,
    } = Arguments::parse();
    let complaint = if FUSES {
        "this build fuses multiplications with additions, so it rounds differently and finds other grips than the shipped \
         ones, which a build for any processor of the architecture finds: build without target-cpu and target-feature"
            .to_owned()
    } else if complete.is_some() && section != Section::Atlases {
        "--complete is an option of the section atlases".to_owned()
    } else if check {
        let is_current = section.is_current(&out, 1);
        return ExitCode::from(u8::from(!is_current));
    } else {
        match section.make(&out, complete.as_deref()) {
            Ok(()) => return ExitCode::SUCCESS,
            Err(error) => error.to_string(),
        }
    };
    eprintln!("{complaint}");
    ExitCode::FAILURE
}

/// Writes a file and the folders above it.
fn write(folder: &Path, (path, bytes): &AssetFile) -> io::Result<()> {
    let to = folder.join(path);
    if let Some(parent) = to.parent() {
        fs::create_dir_all(parent)?;
    }
    let written = fs::write(to, bytes);
    written.map_err(|error| io::Error::new(error.kind(), format!("{path}: cannot be written: {error}")))?;
    println!("{path}: {} bytes", bytes.len());
    Ok(())
}

#[cfg(test)]
mod tests {
    use grasp_cases::cases;

    use super::*;

    #[test]
    fn files_of_the_assets_are_what_is_made_now() {
        if FUSES {
            eprintln!("SKIPPED: this build rounds differently");
            return;
        }
        // A tenth of the atlases, or all.
        let nth = (10 / cases(10)) as usize;
        assert!(Section::All.is_current(Path::new(ASSETS), nth));
    }
}
