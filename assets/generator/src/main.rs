//! Makes the built-in objects, hands, holdouts, atlases and grips of primitives. A rerun gives identical bytes.

mod atlases;
mod hands;
mod holdouts;
mod objects;
mod prospects;

use std::{
    fs, io,
    path::{Path, PathBuf},
    process::ExitCode,
};

use atlases::Kept;
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
    /// Atlases of the objects for both hands of the rig adult; minutes of work. With --check, they are read and some of
    /// their grips found again.
    Atlases,
    /// Grips of the primitives for both hands of the rig adult, for objects without an atlas; minutes of work, and checked
    /// likewise.
    Primitives,
    /// The numbers by which GUIDED search prefers hands that are likely to hold, which are part of `grasp-synthesis`;
    /// minutes of work.
    Prospects,
    /// Objects, hands and holdouts; with --check, atlases and primitives too.
    All,
}

impl Section {
    /// Makes the section's files in memory.
    fn generate(self) -> Vec<AssetFile> {
        match self {
            Self::Objects => objects::generate(),
            Self::Hands => hands::generate(),
            Self::Holdouts => holdouts::generate(),
            Self::Atlases => Kept::All.generate(),
            Self::Primitives => Kept::Listed.generate(),
            Self::Prospects => prospects::generate(),
            Self::All => [Self::Objects, Self::Hands, Self::Holdouts]
                .into_iter()
                .flat_map(Self::generate)
                .collect(),
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
    let grips = match arguments.section {
        Section::Atlases | Section::Primitives => true,
        Section::All => arguments.check,
        Section::Objects | Section::Hands | Section::Holdouts | Section::Prospects => false,
    };
    if grips && FUSES {
        eprintln!(
            "grips: this build fuses multiplications with additions, rounds otherwise and finds other grips than one \
             for any processor of the architecture, whose grips the shipped atlases are: build without target-cpu and \
             target-feature"
        );
        return ExitCode::FAILURE;
    }
    if arguments.check {
        return check(&arguments.out, arguments.section);
    }
    let files = arguments.section.generate();
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

/// Names every file of a section below `folder` that is missing or not what is made now.
fn check(folder: &Path, section: Section) -> ExitCode {
    let mut code = ExitCode::SUCCESS;
    let grips: &[Kept] = match section {
        Section::Atlases => &[Kept::All],
        Section::Primitives => &[Kept::Listed],
        Section::All => &[Kept::All, Kept::Listed],
        Section::Objects | Section::Hands | Section::Holdouts | Section::Prospects => &[],
    };
    for kept in grips {
        if !kept.check(folder) {
            code = ExitCode::FAILURE;
        }
    }
    let files = match section {
        Section::Atlases | Section::Primitives => Vec::new(),
        section => section.generate(),
    };
    for (path, bytes) in files {
        match fs::read(folder.join(&path)) {
            Ok(found) if found == bytes => {}
            Ok(_) => {
                println!("{path}: differs");
                code = ExitCode::FAILURE;
            }
            Err(error) => {
                println!("{path}: cannot be read: {error}");
                code = ExitCode::FAILURE;
            }
        }
    }
    code
}
