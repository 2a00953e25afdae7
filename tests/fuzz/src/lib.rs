//! What fuzz targets share: [`Target::run`] measures how long an input takes and how much memory.

mod gltf;
mod requests;

use std::{env, fmt, fs, path::PathBuf, sync::Mutex, time::Duration};

use grasp_characters::ring::Ring;
use grasp_import::Import;
use grasp_server::fuzzing::MESH_LIMITS;
use peak_alloc::PeakAlloc;
use rustix::time::{ClockId, clock_gettime};

pub use gltf::{GLTF_LIMITS, GLTF_WORDS, file, parts};
pub use requests::{names, requests};

#[global_allocator]
static ALLOCATOR: PeakAlloc = PeakAlloc;

/// Most processor time of an input. The program is several times slower than the product: it checks every access and overflow.
const MAX_TIME: Duration = Duration::from_secs(1);

/// Most memory of an input at the peak, beside a multiple of its bytes.
const BYTES_BESIDES: usize = 1 << 20;
const BYTES_PER_BYTE: usize = 4;

/// The longest inputs of most targets.
pub const LONGEST: usize = 1 << 16;

/// The folder where a target puts its seeds, next to its dictionary `.words`; and the file of the largest figures.
const SEEDS: &str = "GRASP_FUZZ_SEEDS";
const FIGURES: &str = "GRASP_FUZZ_FIGURES";

/// A parser that reads any bytes.
pub struct Target {
    /// Reads an input.
    pub read: fn(&[u8]),
    /// Valid inputs.
    pub seeds: fn() -> Vec<Vec<u8>>,
    /// Longer inputs are left out.
    pub longest: usize,
    /// Long inputs that need much memory for their size, each after the memory that it may take, as a multiple of its bytes, besides a
    /// megabyte. They are read once, because changed copies are too slow.
    pub dense: fn() -> Vec<(usize, Vec<u8>)>,
    /// Words of valid inputs.
    pub words: fn() -> Vec<String>,
}

/// Inputs of [`Target::dense`] have about so many bytes, and at most so many triangles.
pub const DENSE_BYTES: usize = 1 << 20;
pub const TRIANGLES: usize = MESH_LIMITS.triangles;

/// Reads a mesh of any format.
pub fn read_mesh(input: &[u8]) {
    let _ = grasp_import::read_mesh(input, Import::METRES, MESH_LIMITS);
}

/// Dense inputs that may take as much memory as others.
pub fn bounded_as_all(inputs: impl IntoIterator<Item = Vec<u8>>) -> Vec<(usize, Vec<u8>)> {
    let inputs = inputs.into_iter();
    inputs.map(|input| (BYTES_PER_BYTE, input)).collect()
}

/// A start, and as many copies of a part as a dense input has room for.
pub fn dense(start: &str, part: &[u8]) -> Vec<u8> {
    dense_within(start, part, usize::MAX)
}

/// The same with few enough copies not to be refused for their number.
pub fn dense_within(start: &str, part: &[u8], most: usize) -> Vec<u8> {
    let copies = most.min(DENSE_BYTES / part.len());
    [start.as_bytes(), &part.repeat(copies)].concat()
}

/// A usual mesh, with coordinates that are short as text.
pub fn grid() -> Ring {
    const SIDES: u32 = 100;
    let places = |sides: u32| (0..sides).flat_map(move |y| (0..sides).map(move |x| (x, y)));
    let position = |(x, y): (u32, u32)| [x, y, x * y % 7].map(f64::from);
    let triangles = |(x, y): (u32, u32)| {
        let corner = y * SIDES + x;
        let [a, b, c, d] = [0, 1, SIDES + 1, SIDES].map(|step| corner + step);
        [[a, b, c], [a, c, d]]
    };
    Ring {
        positions: places(SIDES).map(position).collect(),
        triangles: places(SIDES - 1).flat_map(triangles).collect(),
    }
}

/// Words between spaces.
pub fn words(text: &str) -> Vec<String> {
    text.split_whitespace().map(str::to_owned).collect()
}

/// The largest figures of all inputs.
#[derive(Clone, Copy, Default, PartialEq)]
struct Figures {
    time: Duration,
    /// Of the bound on memory.
    share: f64,
}

static FIGURES_SO_FAR: Mutex<Figures> = Mutex::new(Figures {
    time: Duration::ZERO,
    share: 0.0,
});

impl Target {
    /// Reads its own inputs, and writes seeds and dictionary for the fuzzer.
    pub fn prepare(&self) {
        let seeds = (self.seeds)();
        for seed in &seeds {
            // What is made once does not count.
            (self.read)(seed);
        }
        for seed in &seeds {
            self.run(seed);
        }
        for (place, (bytes_per_byte, input)) in (self.dense)().iter().enumerate() {
            let figures = self.measure(input, *bytes_per_byte);
            eprintln!("dense input {place}: {figures}");
            figures.check();
        }
        let Some(folder) = env::var_os(SEEDS).map(PathBuf::from) else {
            return;
        };
        let write = |file: PathBuf, content: &[u8]| {
            fs::write(file, content).expect("the folder can be written to");
        };
        for (place, seed) in seeds.iter().enumerate() {
            write(folder.join(place.to_string()), seed);
        }
        let words = (self.words)().into_iter().map(|word| {
            let bytes = word.bytes().map(|byte| format!("\\x{byte:02x}"));
            format!("\"{}\"\n", bytes.collect::<String>())
        });
        // An empty file would be refused.
        let words = format!("# Words\n{}", words.collect::<String>());
        write(folder.with_extension("words"), words.as_bytes());
    }

    /// Reads an input.
    ///
    /// # Panics
    /// It takes too long or too much memory.
    pub fn run(&self, input: &[u8]) {
        if input.len() > self.longest {
            return;
        }
        let figures = self.measure(input, BYTES_PER_BYTE);
        record(figures);
        figures.check();
    }

    fn measure(&self, input: &[u8], bytes_per_byte: usize) -> Figures {
        let before = ALLOCATOR.current_usage();
        ALLOCATOR.reset_peak_usage();
        let start = processor_time();
        (self.read)(input);
        let time = processor_time().saturating_sub(start);
        let memory = ALLOCATOR.peak_usage().saturating_sub(before);
        let share = memory as f64 / (bytes_per_byte * input.len() + BYTES_BESIDES) as f64;
        Figures { time, share }
    }
}

impl Figures {
    fn check(self) {
        assert!(
            self.share <= 1.0 && self.time <= MAX_TIME,
            "an input takes too much: {self}"
        );
    }
}

impl fmt::Display for Figures {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let milliseconds = 1000.0 * self.time.as_secs_f64();
        write!(
            f,
            "{milliseconds:.1} ms, {:.0} % of the memory",
            100.0 * self.share
        )
    }
}

fn processor_time() -> Duration {
    let time = clock_gettime(ClockId::ThreadCPUTime);
    Duration::new(time.tv_sec as u64, time.tv_nsec as u32)
}

/// Keeps the largest figures in a file: the fuzzer ends without a word to its target.
fn record(figures: Figures) {
    let Figures { time, share } = figures;
    let mut largest = FIGURES_SO_FAR.lock().expect("a panic ends the process");
    let larger = Figures {
        time: largest.time.max(time),
        share: largest.share.max(share),
    };
    if larger == *largest {
        return;
    }
    *largest = larger;
    if let Some(file) = env::var_os(FIGURES) {
        let text = format!(
            "{:.1} ms\n{:.0} %\n",
            1000.0 * larger.time.as_secs_f64(),
            100.0 * larger.share
        );
        fs::write(file, text).expect("the file can be written to");
    }
}

/// Defines the program of a target.
#[macro_export]
macro_rules! fuzz {
    ($target:expr) => {
        static TARGET: $crate::Target = $target;
        libfuzzer_sys::fuzz_target!(init: TARGET.prepare(), |input: &[u8]| TARGET.run(input));
    };
}
