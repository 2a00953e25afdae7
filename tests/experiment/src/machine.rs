//! The machine that times were measured on.

use std::{fmt, num::NonZeroUsize, time::Instant};

use serde::{Deserialize, Serialize};

/// Clock readings to average.
const CLOCK_READINGS: u32 = 100_000;

/// A machine and a build.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Machine {
    /// The processor's name, where the system provides it.
    pub processor: Option<String>,
    /// Hardware threads.
    pub threads: usize,
    /// "linux" and so on.
    pub operating_system: String,
    /// "aarch64" and so on.
    pub architecture: String,
    /// Relevant instruction sets that the build uses.
    pub target_features: Vec<String>,
    /// Whether the build is optimised.
    pub optimised: bool,
    /// Time of one clock reading, of which a step's time contains about one.
    pub clock_nanoseconds: f64,
}

impl Machine {
    /// This machine and build.
    pub fn this() -> Self {
        let mut target_features = Vec::new();
        for (name, is_used) in [
            ("avx2", cfg!(target_feature = "avx2")),
            ("fma", cfg!(target_feature = "fma")),
            ("avx512f", cfg!(target_feature = "avx512f")),
            ("neon", cfg!(target_feature = "neon")),
        ] {
            if is_used {
                target_features.push(name.to_owned());
            }
        }
        let start = Instant::now();
        for _ in 0..CLOCK_READINGS {
            std::hint::black_box(Instant::now());
        }
        let clock_nanoseconds = start.elapsed().as_nanos() as f64 / f64::from(CLOCK_READINGS);
        Self {
            processor: processor(),
            threads: std::thread::available_parallelism().map_or(1, NonZeroUsize::get),
            operating_system: std::env::consts::OS.to_owned(),
            architecture: std::env::consts::ARCH.to_owned(),
            target_features,
            optimised: !cfg!(debug_assertions),
            // One decimal: more would suggest false precision.
            clock_nanoseconds: (clock_nanoseconds * 10.0).round() / 10.0,
        }
    }

    /// Whether times of both machines may be compared.
    pub fn is_like(&self, other: &Self) -> bool {
        Self {
            clock_nanoseconds: other.clock_nanoseconds,
            ..self.clone()
        } == *other
    }
}

impl fmt::Display for Machine {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let processor = self.processor.as_deref().unwrap_or(&self.architecture);
        let threads = if self.threads == 1 { "thread" } else { "threads" };
        write!(
            f,
            "{processor}, {} {threads}, {}",
            self.threads, self.operating_system
        )?;
        if !self.target_features.is_empty() {
            write!(f, ", built for {}", self.target_features.join(" "))?;
        }
        if !self.optimised {
            write!(f, ", built without optimisation")?;
        }
        Ok(())
    }
}

/// Linux names it in a file; elsewhere the architecture stands in.
fn processor() -> Option<String> {
    let text = std::fs::read_to_string("/proc/cpuinfo").ok()?;
    let line = text.lines().find(|line| line.starts_with("model name"))?;
    let (_, name) = line.split_once(':')?;
    Some(name.trim().to_owned())
}
