//! The cores of this machine, shared between the server and the generator of load.

use std::{
    fs, io,
    path::Path,
    process::{Command, Stdio},
    time::Instant,
};

/// One core in so many is the generator's.
const SHARE_OF_GENERATOR: usize = 4;

/// Numbers of cores.
#[derive(Clone, Debug)]
pub(crate) struct Cores(Vec<usize>);

/// Who has which cores, so that the generator takes none of the server's.
#[derive(Clone, Debug)]
pub(crate) struct Split {
    /// Cores of the server.
    pub(crate) server: Cores,
    /// Cores of this process.
    pub(crate) generator: Cores,
    /// All of them.
    pub(crate) all: Cores,
}

impl Cores {
    /// How many there are.
    pub(crate) fn count(&self) -> usize {
        self.0.len()
    }

    /// As a list for `taskset`.
    pub(crate) fn list(&self) -> String {
        let numbers: Vec<String> = self.0.iter().map(usize::to_string).collect();
        numbers.join(",")
    }

    /// Makes this process run on them only.
    pub(crate) fn pin_this_process(&self) -> io::Result<()> {
        let pinned = Command::new("taskset")
            .args(["--all-tasks", "--cpu-list", "--pid", &self.list()])
            .arg(std::process::id().to_string())
            .stdout(Stdio::null())
            .status()?;
        if pinned.success() {
            Ok(())
        } else {
            Err(io::Error::other(format!("taskset ended with {pinned}")))
        }
    }

    /// A command that runs a program on them only.
    pub(crate) fn command(&self, program: &Path) -> Command {
        let mut command = Command::new("taskset");
        command.args(["--cpu-list", &self.list()]).arg(program);
        command
    }
}

impl Split {
    /// Splits the cores that this process may use.
    ///
    /// # Errors
    /// There are less than two, or the system does not list them.
    pub(crate) fn of_this_process() -> io::Result<Self> {
        let status = fs::read_to_string("/proc/self/status")?;
        let list = status
            .lines()
            .find_map(|line| line.strip_prefix("Cpus_allowed_list:"));
        let all = list.and_then(|list| cores_in(list.trim()));
        let all = all.ok_or_else(|| io::Error::other("no Cpus_allowed_list in /proc/self/status"))?;
        if all.len() < 2 {
            return Err(io::Error::other("server and generator need a core each"));
        }
        let of_generator = (all.len() / SHARE_OF_GENERATOR).max(1);
        let (server, generator) = all.split_at(all.len() - of_generator);
        Ok(Self {
            server: Cores(server.to_vec()),
            generator: Cores(generator.to_vec()),
            all: Cores(all.clone()),
        })
    }
}

/// Processor time of the machine that neither this process nor its ended children took.
#[derive(Clone, Copy, Debug)]
pub(crate) struct TimeOfOthers {
    at: Instant,
    seconds: f64,
}

impl TimeOfOthers {
    /// Up to now, since the start of machine and process.
    pub(crate) fn now() -> io::Result<Self> {
        let (all, own) = (
            fs::read_to_string("/proc/stat")?,
            fs::read_to_string("/proc/self/stat")?,
        );
        let seconds = seconds_of_others(&all, &own);
        Ok(Self {
            at: Instant::now(),
            seconds: seconds.ok_or_else(|| io::Error::other("no times in /proc/stat or /proc/self/stat"))?,
        })
    }

    /// Cores that others have taken in the mean since an earlier moment.
    pub(crate) fn cores_since(self, before: Self) -> f64 {
        (self.seconds - before.seconds) / (self.at - before.at).as_secs_f64()
    }
}

/// Seconds in the times of the machine that are not in the times of a process. Interrupts belong to nobody: load over the network
/// makes them.
fn seconds_of_others(machine: &str, process: &str) -> Option<f64> {
    const TICKS_PER_SECOND: f64 = 100.0;
    let [user, nice, system, _, _, _, _, steal] = numbers(machine.lines().next()?.strip_prefix("cpu")?)?;
    // The name of the program may have spaces.
    let (_, after_name) = process.rsplit_once(')')?;
    let (_, times) = after_name.split_at(after_name.match_indices(' ').nth(11)?.0);
    let own: [f64; 4] = numbers(times)?;
    Some((user + nice + system + steal - own.iter().sum::<f64>()) / TICKS_PER_SECOND)
}

/// The first numbers of a text.
fn numbers<const N: usize>(text: &str) -> Option<[f64; N]> {
    let numbers: Option<Vec<f64>> = text
        .split_whitespace()
        .take(N)
        .map(|word| word.parse().ok())
        .collect();
    numbers?.try_into().ok()
}

/// The numbers in a list such as `0-2,5`.
fn cores_in(list: &str) -> Option<Vec<usize>> {
    let mut cores = Vec::new();
    for range in list.split(',') {
        let (first, last) = range.split_once('-').unwrap_or((range, range));
        cores.extend(first.parse::<usize>().ok()?..=last.parse().ok()?);
    }
    Some(cores)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn lists_of_cores_are_read_as_linux_writes_them() {
        assert_eq!(cores_in("0-2,5"), Some(vec![0, 1, 2, 5]));
        assert_eq!(cores_in("7"), Some(vec![7]));
        assert_eq!(cores_in("x"), None);
    }

    #[test]
    fn the_time_of_others_is_that_of_the_machine_without_own_and_childrens() {
        let machine = "cpu  1000 200 300 9000 50 60 70 80 5 5\ncpu0 1 2 3";
        let process = "42 (a (b) c) S 1 42 42 0 -1 4194560 9 9 9 9 110 40 20 10 20 0 3 0 77";
        assert_eq!(seconds_of_others(machine, process), Some(14.0));
        assert_eq!(seconds_of_others("cpu  1 2", process), None);
    }
}
