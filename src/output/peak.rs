//! How much memory the process has used.

/// The most memory that this process has held resident, bytes; 0 where the system does not say (it is read from
/// Linux's `/proc/self/status`).
pub fn peak_bytes() -> u64 {
    std::fs::read_to_string("/proc/self/status").ok().and_then(|status| high_water_mark(&status)).unwrap_or(0)
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
}
