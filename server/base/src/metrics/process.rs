//! Figures of the process from /proc, under the usual names. They are read here, since published crates for it bring a
//! parser for all of /proc.

use std::fs;

use prometheus_client::{
    metrics::{counter::ConstCounter, gauge::ConstGauge},
    registry::Registry,
};

/// Adds the figures that can be read; on systems other than Linux there are none.
pub(super) fn register(registry: &mut Registry) {
    let mut gauge = |name: &str, help: &str, value: Option<f64>| {
        if let Some(value) = value {
            registry.register(name, help, ConstGauge::new(value));
        }
    };
    let status = fs::read_to_string("/proc/self/status").unwrap_or_default();
    let (resident, virtual_) = (kib(&status, "VmRSS:"), kib(&status, "VmSize:"));
    gauge("process_resident_memory_bytes", "Resident memory", resident);
    gauge("process_virtual_memory_bytes", "Virtual memory", virtual_);
    gauge(
        "process_threads",
        "Number of threads",
        field(&status, "Number of threads:"),
    );
    let open = fs::read_dir("/proc/self/fd").ok();
    let open = open.map(|entries| entries.count() as f64);
    gauge("process_open_fds", "Open file descriptors", open);
    let most = rustix::process::getrlimit(rustix::process::Resource::Nofile);
    let most = most.current.map(|most| most as f64);
    gauge(
        "process_max_fds",
        "Largest number of open file descriptors",
        most,
    );
    let ticks = rustix::param::clock_ticks_per_second() as f64;
    let stat = fs::read_to_string("/proc/self/stat").unwrap_or_default();
    let times = stat_times(&stat);
    let booted = fs::read_to_string("/proc/stat").unwrap_or_default();
    let booted = field(&booted, "btime");
    let started = booted
        .zip(times)
        .map(|(booted, (_, start))| booted + start / ticks);
    gauge(
        "process_start_time_seconds",
        "Start of the process, in seconds since 1970",
        started,
    );
    if let Some((used, _)) = times {
        let used = ConstCounter::new(used / ticks);
        registry.register(
            "process_cpu_seconds",
            "Processor time (user and system), in seconds",
            used,
        );
    }
}

fn field(text: &str, name: &str) -> Option<f64> {
    let line = text.lines().find_map(|line| line.strip_prefix(name))?;
    line.split_whitespace().next()?.parse().ok()
}

fn kib(text: &str, name: &str) -> Option<f64> {
    field(text, name).map(|kib| kib * 1024.0)
}

/// The ticks of processor time, and the ticks from the start of the machine to that of the process. Fields are counted
/// from after the name of the program, which may contain anything.
fn stat_times(stat: &str) -> Option<(f64, f64)> {
    let fields: Vec<&str> = stat.rsplit_once(')')?.1.split_whitespace().collect();
    let ticks = |k: usize| fields.get(k)?.parse::<f64>().ok();
    Some((ticks(11)? + ticks(12)?, ticks(19)?))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn fields_are_found_behind_any_name() {
        let stat = "7 (a ) b) S 1 7 7 0 -1 0 1 2 3 4 250 50 0 0 20 0 9 0 1234 5 6";
        assert_eq!(stat_times(stat), Some((300.0, 1234.0)));
        assert_eq!(stat_times("7 (a"), None);
        assert_eq!(kib("Name: x\nVmRSS:\t  2 kB\n", "VmRSS:"), Some(2048.0));
    }
}
