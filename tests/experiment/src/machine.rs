//! What the times were measured on.

use std::{fmt, num::NonZeroUsize, time::Instant};

use serde::{Deserialize, Serialize};

/// Clock readings that are averaged. More take longer.
const CLOCK_READINGS: u32 = 100_000;

/// A machine and a build.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Machine {
    /// The processor's name, where the system tells.
    pub processor: Option<String>,
    /// Threads that run at once.
    pub threads: usize,
    /// "linux" and so on.
    pub operating_system: String,
    /// "aarch64" and so on.
    pub architecture: String,
    /// Of the instruction sets that matter, those that the build uses.
    pub target_features: Vec<String>,
    /// Was it built with optimisation?
    pub optimised: bool,
    /// What reading the clock costs. A step's time contains about one reading.
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
            // With one decimal: more would only look exact.
            clock_nanoseconds: (clock_nanoseconds * 10.0).round() / 10.0,
        }
    }

    /// True if times of the two may stand in one table.
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
        write!(
            f,
            "{processor}, {} threads, {}",
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

/// Linux tells in a file; elsewhere the architecture has to do.
fn processor() -> Option<String> {
    let text = std::fs::read_to_string("/proc/cpuinfo").ok()?;
    let line = text.lines().find(|line| line.starts_with("model name"))?;
    let (_, name) = line.split_once(':')?;
    Some(name.trim().to_owned())
}
