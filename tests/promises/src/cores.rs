//! The cores of this machine, shared between the server and the generator of load.

use std::{
    fs, io,
    path::Path,
    process::{Command, Stdio},
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
}
