//! Makes the built-in objects, hands and holdouts, and the grips that ship with the server. A rerun gives identical bytes.

mod algorithm;
mod atlases;
#[cfg(test)]
mod built_in;
mod hands;
mod holdouts;
mod objects;
mod screens;
mod success_prior;

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

/// Makes the built-in objects, hands and holdouts.
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

    /// Looks for better synthesized holdouts with this many seeds and records what was chosen, instead of making
    /// anything; takes minutes.
    #[arg(long, value_name = "SEEDS", num_args = 0..=1, default_missing_value = "200")]
    search: Option<u64>,

    /// Searches for, measures or draws only the holdouts whose names contain this.
    #[arg(long, value_name = "NAME", default_value = "")]
    only: String,

    /// Measures the holdouts, including how many attempts a receiver needs, instead of making anything.
    #[arg(long)]
    report: bool,

    /// Draws the holdouts into this folder instead of making anything.
    #[arg(long, value_name = "DIR")]
    pictures: Option<PathBuf>,
}

/// A part of the assets.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
enum Section {
    /// Scissors, scalpel and remote.
    Objects,
    /// Rigs and skins of the hands.
    Hands,
    /// The 15 holdouts; made with the objects and hands that are embedded in this program.
    Holdouts,
    /// The number that names how atlases grow, which is part of `grasp-synthesis`. Where it changes, atlases and primitives
    /// must be made again.
    Algorithm,
    /// The grips of the objects that ship with the server, for both hands of the rig adult; takes minutes. With --check,
    /// the start of growth and some grips are compared.
    Atlases,
    /// Grips of the primitives for both hands of the rig adult, for objects without an atlas; takes minutes, and is
    /// checked in the same way.
    Primitives,
    /// The network by which GUIDED search prefers hands that are likely to hold, which is part of `grasp-synthesis`;
    /// takes minutes.
    SuccessPrior,
    /// The order in which hands are screened against each other, which is part of `grasp-synthesis`. Made from complete
    /// atlases, which are grown first where none are kept.
    Screens,
    /// Objects, hands and holdouts; with --check, the algorithm, atlases and primitives too.
    All,
}

impl Section {
    /// Makes the section's files in memory. Complete atlases go into the folder `complete` if there is one.
    fn generate(self, complete: Option<&Path>) -> io::Result<Vec<AssetFile>> {
        match self {
            Self::Atlases => Collection::Objects.generate(complete),
            Self::Primitives => Collection::Primitives.generate(None),
            _ => Ok(self.compared_files()),
        }
    }

    /// Makes the files that a check compares byte by byte.
    fn compared_files(self) -> Vec<AssetFile> {
        match self {
            Self::Objects => objects::generate(),
            Self::Hands => hands::generate(),
            Self::Holdouts => holdouts::generate(),
            Self::Algorithm => algorithm::generate(),
            Self::SuccessPrior => success_prior::generate(),
            Self::Screens => screens::generate(),
            Self::All => [objects::generate(), hands::generate(), holdouts::generate()].concat(),
            Self::Atlases | Self::Primitives => Vec::new(),
        }
    }

    /// Does growth decide what the section comes to?
    fn depends_on_growth(self, is_check: bool) -> bool {
        match self {
            Self::Algorithm | Self::Atlases | Self::Primitives | Self::Screens => true,
            Self::All => is_check,
            Self::Objects | Self::Hands | Self::Holdouts | Self::SuccessPrior => false,
        }
    }
}

fn main() -> ExitCode {
    let arguments = Arguments::parse();
    if arguments.report {
        holdouts::report(&arguments.only);
        return ExitCode::SUCCESS;
    }
    if let Some(seeds) = arguments.search {
        return exit_code("the selection", holdouts::search(seeds, &arguments.only));
    }
    if let Some(folder) = &arguments.pictures {
        return exit_code("the pictures", holdouts::pictures(folder, &arguments.only));
    }
    let section = arguments.section;
    if section.depends_on_growth(arguments.check) && FUSES {
        eprintln!(
            "this build fuses multiplications with additions, so it rounds differently and finds other grips than the \
             shipped ones, which a build for any processor of the architecture finds: build without target-cpu and \
             target-feature"
        );
        return ExitCode::FAILURE;
    }
    if arguments.complete.is_some() && section != Section::Atlases {
        eprintln!("--complete is an option of the section atlases");
        return ExitCode::FAILURE;
    }
    if arguments.check {
        return if is_current(&arguments.out, section, 1) {
            ExitCode::SUCCESS
        } else {
            ExitCode::FAILURE
        };
    }
    if matches!(section, Section::Atlases | Section::Primitives) && !algorithm::is_current() {
        eprintln!(
            "atlases grow differently than the algorithm's number says: run the section algorithm first"
        );
        return ExitCode::FAILURE;
    }
    let files = match section.generate(arguments.complete.as_deref()) {
        Ok(files) => files,
        Err(error) => {
            eprintln!("the complete atlases cannot be written: {error}");
            return ExitCode::FAILURE;
        }
    };
    for (path, bytes) in &files {
        if let Err(error) = write(&arguments.out.join(path), bytes) {
            eprintln!("{path}: cannot be written: {error}");
            return ExitCode::FAILURE;
        }
        println!("{path}: {} bytes", bytes.len());
    }
    ExitCode::SUCCESS
}

/// Says what could not be written.
fn exit_code(what: &str, result: io::Result<()>) -> ExitCode {
    match result {
        Ok(()) => ExitCode::SUCCESS,
        Err(error) => {
            eprintln!("{what} cannot be written: {error}");
            ExitCode::FAILURE
        }
    }
}

/// Writes a file and the folders above it.
fn write(path: &Path, bytes: &[u8]) -> io::Result<()> {
    if let Some(folder) = path.parent() {
        fs::create_dir_all(folder)?;
    }
    fs::write(path, bytes)
}

/// Prints every file of a section below `folder` that is missing or not what is made now; true if there is none. Looks at every
/// `nth` atlas only.
fn is_current(folder: &Path, section: Section, nth: usize) -> bool {
    let collections: &[Collection] = match section {
        Section::Atlases => &[Collection::Objects],
        Section::Primitives => &[Collection::Primitives],
        Section::All => &[Collection::Objects, Collection::Primitives],
        _ => &[],
    };
    let mut is_current = true;
    for collection in collections {
        is_current &= collection.check(folder, nth);
    }
    let mut files = section.compared_files();
    if section == Section::All {
        files.extend(algorithm::generate());
    }
    for (path, bytes) in files {
        match fs::read(folder.join(&path)) {
            Ok(found) if found == bytes => {}
            Ok(_) => {
                println!("{path}: differs");
                is_current = false;
            }
            Err(error) => {
                println!("{path}: cannot be read: {error}");
                is_current = false;
            }
        }
    }
    is_current
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
        for section in [Section::All, Section::Screens] {
            assert!(is_current(Path::new(ASSETS), section, nth), "{section:?}");
        }
    }
}
