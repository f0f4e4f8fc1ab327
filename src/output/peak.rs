//! How much memory the process has used, and may use.

/// The most memory that this process has held resident, bytes; 0 where the system does not say (it is read from
/// Linux's `/proc/self/status`).
pub fn peak_bytes() -> u64 {
    std::fs::read_to_string("/proc/self/status").ok().and_then(|status| high_water_mark(&status)).unwrap_or(0)
}

/// The most memory that this process could hold, bytes: the machine's and its swap space, or the limit on a process's
/// addresses (`ulimit -v`) if that is less. None where the system does not say (it is read from Linux's `/proc`).
pub fn most_bytes() -> Option<u64> {
    let read = |path: &str| std::fs::read_to_string(path).ok();
    let machine = read("/proc/meminfo").and_then(|text| memory_and_swap(&text));
    let limit = read("/proc/self/limits").and_then(|text| address_space(&text));
    machine.into_iter().chain(limit).min()
}

fn memory_and_swap(meminfo: &str) -> Option<u64> {
    let of = |name: &str| {
        let line = meminfo.lines().find_map(|line| line.strip_prefix(name))?;
        line.trim().strip_suffix("kB")?.trim().parse::<u64>().ok()
    };
    Some((of("MemTotal:")? + of("SwapTotal:").unwrap_or(0)) * 1024)
}

/// The soft limit on addresses; none if it is unlimited.
fn address_space(limits: &str) -> Option<u64> {
    let line = limits.lines().find_map(|line| line.strip_prefix("Max address space"))?;
    line.split_whitespace().next()?.parse().ok()
}

fn high_water_mark(status: &str) -> Option<u64> {
    let line = status.lines().find_map(|line| line.strip_prefix("VmHWM:"))?;
    let kibibytes: u64 = line.trim().strip_suffix("kB")?.trim().parse().ok()?;
    Some(kibibytes * 1024)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_high_water_mark_is_found_or_nothing_is() {
        assert_eq!(high_water_mark("Name:\tbuzz\nVmHWM:\t   12 kB\nVmRSS:\t 8 kB\n"), Some(12 * 1024));
        assert_eq!(high_water_mark("Name:\tbuzz\n"), None);
        assert_eq!(high_water_mark("VmHWM:\tlots\n"), None);
        #[cfg(target_os = "linux")]
        assert!(peak_bytes() > 1 << 16);
    }

    #[test]
    fn what_there_is_is_the_least_that_the_system_says() {
        assert_eq!(memory_and_swap("MemTotal:       10 kB\nSwapTotal:       2 kB\n"), Some(12 * 1024));
        assert_eq!(memory_and_swap("SwapTotal:       2 kB\n"), None);
        let limits =
            |soft: &str| format!("Limit  Soft  Hard  Units\nMax address space  {soft}  unlimited  bytes\n");
        assert_eq!(address_space(&limits("4096")), Some(4096));
        assert_eq!(address_space(&limits("unlimited")), None);
        #[cfg(target_os = "linux")]
        assert!(most_bytes().is_some_and(|most| most > peak_bytes()));
    }
}
