//! Metrics of the process, with the usual names. Without `/proc` there are none.

use std::{fs, sync::LazyLock, time::SystemTime};

use crate::metrics::Exposition;

/// When the first page was made or, if earlier, the server: moments after the process started.
static START: LazyLock<SystemTime> = LazyLock::new(SystemTime::now);

/// Notes the time of the start.
pub(super) fn started() {
    LazyLock::force(&START);
}

pub(super) fn write(page: &mut Exposition) {
    let start = START
        .duration_since(SystemTime::UNIX_EPOCH)
        .unwrap_or_default()
        .as_secs_f64();
    page.gauge(
        "process_start_time_seconds",
        "When the server started, since 1970.",
        start,
    );
    let status = fs::read_to_string("/proc/self/status").unwrap_or_default();
    for (name, help, title) in [
        ("process_resident_memory_bytes", "Resident memory.", "VmRSS:"),
        ("process_virtual_memory_bytes", "Reserved memory.", "VmSize:"),
    ] {
        if let Some(kilobytes) = number_after(&status, title) {
            page.gauge(name, help, 1024 * kilobytes);
        }
    }
    #[cfg(target_os = "linux")]
    {
        let used = rustix::time::clock_gettime(rustix::time::ClockId::ProcessCPUTime);
        let seconds = used.tv_sec as f64 + 1e-9 * used.tv_nsec as f64;
        page.counter("process_cpu_seconds_total", "Time on processors.", seconds);
    }
    if let Ok(files) = fs::read_dir("/proc/self/fd") {
        page.gauge("process_open_fds", "Open files and sockets.", files.count());
    }
    if let Some(most) = rustix::process::getrlimit(rustix::process::Resource::Nofile).current {
        page.gauge("process_max_fds", "Most open files and sockets.", most);
    }
}

/// The first word after a title if it is a number.
fn number_after(text: &str, title: &str) -> Option<u64> {
    let rest = text.lines().find_map(|line| line.strip_prefix(title))?;
    rest.split_whitespace().next()?.parse().ok()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_follow_their_titles() {
        let text = "VmPeak:\t 9 kB\nVmRSS:\t  1234 kB\nX: unlimited";
        assert_eq!(number_after(text, "VmRSS:"), Some(1234));
        assert_eq!(number_after(text, "X:"), None);
        assert_eq!(number_after(text, "Y:"), None);
    }
}
